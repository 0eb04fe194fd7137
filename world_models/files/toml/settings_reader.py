"""Typed settings: tables of a scenario file read into frozen dataclasses, with units in the keys.

A field ``height_m`` may be written ``height_m``, ``height_cm``, ``height_ft`` or ``height_in``; ``tilt_rad`` also
``tilt_deg``.
"""

from __future__ import annotations

import difflib
import math
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar, get_args, get_type_hints

from world_models.files.toml.source import Node, WorldError
from world_models.units import FOOT_M, INCH_M, OutOfBoundsError

T = TypeVar("T")
MAX_NUMBER = 10**9
"""Largest absolute value of a setting."""


def spellings(field: str) -> dict[str, float]:
    """The keys under which a field may be written, each with its factor to SI."""
    out = {field: 1.0}
    if "_rad" in field:
        out[field.replace("_rad", "_deg")] = math.pi / 180.0
    if field.endswith("_m") and not field.endswith("_per_m"):
        out |= {field[:-1] + "cm": 0.01, field[:-1] + "ft": FOOT_M, field[:-1] + "in": INCH_M}
    return out


def known_keys(kind: type[Any]) -> dict[str, tuple[str, float]]:
    """Every key that a settings class understands: its field and the factor to SI."""
    return {key: (f.name, factor) for f in fields(kind) for key, factor in spellings(f.name).items()}


def read_settings(node: Node, kind: type[T]) -> T:
    """A table as an object of a settings class; absent keys keep their defaults. Its fields may be tables themselves.

    Raises:
        WorldError: unknown key, wrong type, or values that do not go together.
    """
    known = known_keys(kind)
    hints = get_type_hints(kind)
    values: dict[str, Any] = {}
    written: dict[str, str] = {}
    for key, item in node.entries():
        if key not in known:
            raise item.fail(f"{suggest_keys(key, known)}", f"the key {key!r}")
        name, factor = known[key]
        if name in values:
            raise item.fail(f"only one of {written[name]} and {key}", "both")
        values[name], written[name] = _value(item, hints[name], factor), key
    try:
        return kind(**values)
    except WorldError:
        raise
    except OutOfBoundsError as error:
        if error.key not in written:
            raise WorldError(f"{node.place}: {error}") from None
        key = written[error.key]
        number = "a whole number" if hints[error.key] is int else "a number"
        raise node[key].fail(f"{number} {error.bounds.describe(known[key][1])}") from None
    except (TypeError, ValueError) as error:
        raise WorldError(f"{node.place}: {error}") from None


def read_all(table: Node, key: str, kind: type[T]) -> tuple[T, ...]:
    """The objects of an array of tables; none where the key is absent. Raises WorldError."""
    return tuple(read_settings(item, kind) for item in table[key].items()) if key in table else ()


def _value(item: Node, hint: Any, factor: float) -> Any:
    inner = get_args(hint)[0] if get_args(hint) else hint
    if isinstance(inner, type) and is_dataclass(inner):
        return read_settings(item, hint) if inner is hint else tuple(read_settings(one, inner) for one in item.items())
    if hint is bool:
        return item.flag()
    if hint is str:
        return item.text()
    if hint is int:
        if isinstance(item.value, bool) or not isinstance(item.value, int):
            raise item.fail("a whole number")
        if abs(item.value) > MAX_NUMBER:
            raise item.fail(f"a whole number from {-MAX_NUMBER} to {MAX_NUMBER}")
        return item.value
    if hint == tuple[float, ...]:
        return tuple(number.number(-MAX_NUMBER, MAX_NUMBER) for number in item.items())
    return item.number(-MAX_NUMBER, MAX_NUMBER) * factor


MAX_NAMED = 12
"""Number of keys named where none is similar."""


def suggest_keys(key: str, known: Iterable[str]) -> str:
    """What an error expects instead of an unknown key: the most similar keys, or all, or the first few."""
    names = list(known)
    alike = difflib.get_close_matches(key, names, n=4, cutoff=0.5) or names[:MAX_NAMED]
    more = f" ... ({len(names)} in all)" if len(names) > len(alike) == MAX_NAMED else ""
    return "one of " + ", ".join(alike) + more


SWITCHES: Mapping[str, bool] = {"on": True, "yes": True, "off": False, "no": False}
"""How ``--set`` may say true and false besides TOML's own words."""


def parse_value(text: str) -> Any:
    """The value of a ``--set key=value``: on, yes, off or no, a TOML value, or else the text itself."""
    if text.lower() in SWITCHES:
        return SWITCHES[text.lower()]
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        return text


def replace_value(data: Mapping[str, Any], path: tuple[str, ...], value: Any) -> dict[str, Any]:
    """A copy of nested tables with the value at ``path`` replaced or added."""
    head, rest = path[0], path[1:]
    inner = data.get(head, {})
    return {**data, head: replace_value(inner if isinstance(inner, Mapping) else {}, rest, value) if rest else value}
