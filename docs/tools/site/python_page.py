"""The reference of the Python interface: what ``harvey`` exports, from its signatures and docstrings."""

from __future__ import annotations

import dataclasses
import inspect
import re
import types
from collections.abc import Iterator, Mapping, Sequence
from enum import Enum
from functools import cached_property
from typing import Any

import harvey
from docs.tools.site.markdown import describe_fields, prose, table

GROUPS: Mapping[str, tuple[str, ...]] = {
    "Missions and runs": (
        "run", "open_run", "show", "load_scenario", "RecordedRun", "DecisionRecord", "EntryRecord", "Candidate",
        "MissionResult", "TrackPoint", "RunPicture", "BadInput"),
    "Building models": ("load_world", "build_world", "World"),
    "Poses from matched lines": (
        "med_r_and_t", "r_and_t_ml", "planar_from_lines", "PoseEstimate", "PlanarEstimate", "Camera", "CameraMount",
        "Pose", "Pose2"),
    "The blackboard": (
        "KnowledgeSource", "View", "Entry", "Watch", "Change", "Posted", "Revised", "Retracted", "Effect", "Post",
        "Revise", "Retract", "Level", "Scheduler", "Decision", "request", "observation", "inference"),
}
"""Each name that is exported, once."""
SECTION = re.compile(r"^(Args|Attributes|Class attributes|Raises|Returns|Yields):$")
NAMED = re.compile(r"^\w+(, \w+)*$")
LONGEST = 40
"""A default with more letters is shown as three points."""


def describe_python() -> str:
    """Every exported name by what it is for: how it is called, what it does, what it raises."""
    return "\n".join(line for title, names in GROUPS.items() for line in (
        f"## {title}", "", *(line for name in names for line in _describe(name, getattr(harvey, name)))))


def _describe(name: str, what: Any) -> Iterator[str]:
    yield from (f"### harvey.{name}", "")
    if isinstance(what, types.UnionType):
        names = " or ".join(f"`{kind.__name__}`" for kind in what.__args__)
        yield from (f"One of {names}.", "")
    elif inspect.isclass(what):
        yield from _describe_class(name, what)
    else:
        yield from (*_code(name, what), *_text(what))


def _describe_class(name: str, kind: type[Any]) -> Iterator[str]:
    if issubclass(kind, Enum):
        yield from (*_text(kind), "Its members: " + ", ".join(f"`{one.name}`" for one in kind) + ".", "")
    else:
        yield from (*_code(name, kind), *_text(kind, describe_fields(kind)))
    members = [(member, value) for member, value in vars(kind).items() if _is_told(member, value)]
    if members:
        yield from table(("member", "what it is"), [
            (f"`{_member(member, value)}`", _in_a_cell(_callable(value))) for member, value in members])[1:]


def _is_told(member: str, value: Any) -> bool:
    kinds = (types.FunctionType, staticmethod, classmethod, property, cached_property)
    return not member.startswith("_") and isinstance(value, kinds) and bool(inspect.getdoc(_callable(value)))


def _callable(value: Any) -> Any:
    if isinstance(value, property):
        return value.fget
    if isinstance(value, cached_property):
        return value.func
    return value.__func__ if isinstance(value, staticmethod | classmethod) else value


def _member(name: str, value: Any) -> str:
    if isinstance(value, property | cached_property):
        return name
    given = [p for p in inspect.signature(_callable(value)).parameters.values() if p.name not in ("self", "cls")]
    return f"{name}({', '.join(map(_parameter, given))})".replace("|", "\\|")


def _code(name: str, what: Any) -> Sequence[str]:
    """How it is called; nothing for what nobody calls, as an exception or an abstract class."""
    if inspect.isclass(what) and (inspect.isabstract(what) or not dataclasses.is_dataclass(what)):
        return ()
    signature = inspect.signature(what)
    given = [*signature.parameters.values()]
    parts = []
    for number, one in enumerate(given):
        starred = one.kind is one.KEYWORD_ONLY and (number == 0 or given[number - 1].kind is one.POSITIONAL_OR_KEYWORD)
        parts += ["*"] * starred + [_parameter(one)]
        if one.kind is one.POSITIONAL_ONLY and (one is given[-1] or given[number + 1].kind is not one.POSITIONAL_ONLY):
            parts += ["/"]
    returns = "" if inspect.isclass(what) else f" -> {_hint(signature.return_annotation)}"
    line = f"harvey.{name}({', '.join(parts)}){returns}"
    if len(line) <= 100:
        return ("```python", line, "```", "")
    return ("```python", f"harvey.{name}(", *(f"    {part}," for part in parts), f"){returns}", "```", "")


def _parameter(one: inspect.Parameter) -> str:
    stars = {one.VAR_POSITIONAL: "*", one.VAR_KEYWORD: "**"}.get(one.kind, "")
    hint = "" if one.annotation is one.empty else f": {_hint(one.annotation)}"
    if one.default is one.empty:
        return f"{stars}{one.name}{hint}"
    shown = f"{type(one.default).__name__}.{one.default.name}" if isinstance(one.default, Enum) else repr(one.default)
    default = shown if len(shown) <= LONGEST and " at 0x" not in shown and "<" not in shown else "..."
    return f"{one.name}{hint} = {default}" if hint else f"{one.name}={default}"


def _hint(hint: Any) -> str:
    return hint if isinstance(hint, str) else str(getattr(hint, "__name__", hint))


def _text(what: Any, fields: Mapping[str, str] | None = None) -> Iterator[str]:
    """The docstring as Markdown: paragraphs, then its sections as lists; for a class its fields as a table."""
    known = dict(fields or {})
    for paragraph in (inspect.getdoc(what) or "").split("\n\n"):
        head, *rest = paragraph.split("\n")
        section = SECTION.match(head)
        if section is None:
            yield from (prose(paragraph), "")
        elif section[1] == "Attributes" and known:
            yield from table(("attribute", "what it is"), [(f"`{name}`", text) for name, text in known.items()])[1:]
        else:
            yield from (f"{section[1]}:", "", *map(_item, _items(rest)), "")


def _items(lines: Sequence[str]) -> Sequence[str]:
    """The items of a section; what is indented further belongs to the item above it."""
    return [item for item in re.split(r"\n    (?! )", "\n" + "\n".join(lines)) if item.strip()]


def _item(text: str) -> str:
    name, colon, what = text.strip().partition(": ")
    return f"- `{name}`: {prose(what)}" if colon and NAMED.match(name) else f"- {prose(text)}"


def _in_a_cell(what: Any) -> str:
    return " ".join(line.removeprefix("- ") for line in _text(what) if line)
