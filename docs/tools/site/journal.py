"""The reference of ``journal.jsonl``, and its JSON Schema, from the kinds of entries.

``python -m docs.tools.fill`` writes both again. Where a reader of the old journal would fail on the new
one, raise :data:`logs.run_directory.JOURNAL_VERSION` first.
"""

from __future__ import annotations

import collections.abc
import dataclasses
import json
import types
import typing
from collections.abc import Iterator, Mapping
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from blackboard import NOT_FINITE, Level, Role, kind_of
from docs.tools.site.markdown import describe_fields, escape, summary, table
from harvey.wiring import OWN_KINDS
from logs.run_directory import JOURNAL_VERSION

SCHEMA = Path(__file__).parents[2] / "reference" / "journal.schema.json"
ROLES: Mapping[Role, str] = {
    Role.OBSERVATION: "Observations: from outside", Role.REQUEST: "Requests: what ports act on",
    Role.INFERENCE: "Inferences: what knowledge sources conclude",
}
REF = {"type": "string", "pattern": r"^\w+-\d+\.\d+$"}
REFS = {"type": "array", "items": REF}
NUMBER = {"anyOf": [{"type": "number"}, {"enum": sorted(NOT_FINITE)}]}
SIMPLE: Mapping[Any, Mapping[str, Any]] = {
    bool: {"type": "boolean"}, int: {"type": "integer"}, float: NUMBER, str: {"type": "string"},
    bytes: {"type": "object", "required": ["bytes", "sha256"]},
}


def describe_kinds() -> str:
    """Every kind of entry by its role: what it is, and its fields."""
    kinds = OWN_KINDS
    return "\n".join(line for role, title in ROLES.items() for line in (
        f"## {title}", "", *(line for kind in kinds.of_role(role) for line in _describe(kind))))


def _describe(kind: type[Any]) -> Iterator[str]:
    keep = kind_of(kind).keep
    kept = "All of them stay in memory." if keep is None else f"The newest {keep} always stay in memory."
    known, hints = describe_fields(kind), typing.get_type_hints(kind)
    yield from (f"### {kind.__name__}", "", summary(kind), kept)
    yield from table(("field", "type", "meaning"), [
        (f"`{field.name}`", escape(_name(hints[field.name])), known.get(field.name, ""))
        for field in dataclasses.fields(kind)])


def _name(hint: Any) -> str:
    """A type as its documentation names it."""
    if typing.get_origin(hint) is np.ndarray:
        return "array"
    if typing.get_origin(hint) is typing.Literal:
        return " or ".join(map(repr, typing.get_args(hint)))
    if typing.get_origin(hint) in (types.UnionType, typing.Union):
        return " or ".join(map(_name, typing.get_args(hint)))
    if typing.get_origin(hint) is tuple and Ellipsis in typing.get_args(hint):
        return f"list of {_name(typing.get_args(hint)[0])}"
    if arguments := typing.get_args(hint):
        inside = ", ".join(map(_name, arguments))
        return f"{typing.get_origin(hint).__name__} of {inside}"
    return "none" if hint is type(None) else str(getattr(hint, "__name__", hint))


def build_schema() -> dict[str, Any]:
    """The JSON Schema of one line of ``journal.jsonl``. Kinds of entries of other packages are let through."""
    parts: dict[str, Any] = {}
    kinds = OWN_KINDS
    by_type = [{"if": {"properties": {"type": {"const": name}}},
                "then": {"properties": {"value": _schema(kind, parts)}}} for name, kind in sorted(kinds.items())]
    texts = {name: {"type": "string"} for name in ("type", "author")}
    change = _object({"change": {"enum": ["Posted", "Revised", "Retracted"]}, "entry": REF, **texts, "because": REFS,
                      "value": True}, retracted_because=REFS)
    levels = {"enum": [str(level) for level in Level]}
    activation = {
        "number": {"type": "integer"}, "source": {"type": "string"}, "level": levels, "trigger": REF,
        "kind": change["properties"]["change"], "rating": NUMBER, "since": {"type": "integer"}}
    either = {"anyOf": [{"type": "null"}, {"$ref": "#/$defs/activation"}]}
    changes = {"type": "array", "items": {"$ref": "#/$defs/change"}}
    decision = _object({
        "cycle": {"type": "integer", "minimum": 1}, "focus": levels, "observed": changes, "seen": REFS,
        "activated": {"type": "array", "items": {"$ref": "#/$defs/activation"}},
        "obviated": {"type": "array", "items": _object({**activation, "reason": {"type": "string"}})},
        "chosen": either, "runner_up": either, "pending": {"type": "integer", "minimum": 0}, "made": changes,
        "refused": {"type": "string"}}, used=REFS)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema", "$id": f"harvey-journal-{JOURNAL_VERSION}",
        "title": f"A decision: one line of journal.jsonl, version {JOURNAL_VERSION}", **decision,
        "$defs": {
            "change": {**change, "allOf": by_type}, "activation": _object(activation), **dict(sorted(parts.items()))},
    }


def _object(properties: Mapping[str, Any], **optional: Any) -> dict[str, Any]:
    return {"type": "object", "properties": {**properties, **optional}, "required": list(properties),
            "additionalProperties": False}


def _schema(hint: Any, parts: dict[str, Any]) -> Any:
    """What :func:`blackboard.journal.plain` makes of a value of a type; dataclasses are added to ``parts`` by name."""
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint in SIMPLE:
        return SIMPLE[hint]
    if origin in (types.UnionType, typing.Union):
        return {"anyOf": [_schema(one, parts) for one in arguments]}
    if hint is type(None):
        return {"type": "null"}
    if origin is typing.Literal:
        return {"enum": list(arguments)}
    if origin is np.ndarray or origin is collections.abc.Mapping:
        return {"type": "array" if origin is np.ndarray else "object"}
    if origin is tuple and Ellipsis in arguments:
        return {"type": "array", "items": _schema(arguments[0], parts)}
    if origin is tuple:
        return {"type": "array", "prefixItems": [_schema(one, parts) for one in arguments],
                "minItems": len(arguments), "maxItems": len(arguments)}
    if isinstance(hint, type) and issubclass(hint, Enum):
        return {"enum": [member.name.lower() for member in hint]}
    if dataclasses.is_dataclass(hint) and isinstance(hint, type):
        return _dataclass(hint, parts)
    return True


def _dataclass(kind: type[Any], parts: dict[str, Any]) -> Any:
    if hasattr(kind, "journal_form"):
        return _schema(typing.get_type_hints(kind.journal_form)["return"], parts)
    if kind.__name__ not in parts:
        parts[kind.__name__] = True  # until it is known: a class may hold itself
        hints = typing.get_type_hints(kind)
        parts[kind.__name__] = _object({f.name: _schema(hints[f.name], parts) for f in dataclasses.fields(kind)})
    return {"$ref": f"#/$defs/{kind.__name__}"}


def format_schema() -> str:
    """The schema as its file has it."""
    return json.dumps(build_schema(), indent=1) + "\n"

