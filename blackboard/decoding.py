"""Decoding: values on the board again from the JSON types of a journal or of ``run.json``."""

from __future__ import annotations

import collections.abc
import dataclasses
import types
import typing
from collections.abc import Callable, Mapping
from enum import Enum
from typing import Any

from blackboard.journal import NOT_FINITE

WORDS: Mapping[type[Any], str] = {
    float: "a number", int: "a whole number", str: "a text", bool: "true or false", dict: "an object", list: "a list"}
"""What a user calls a type."""

Decoders = Mapping[Any, Callable[[Any, tuple[Any, ...]], Any]]
"""How values of other generic types, as arrays, come from JSON types and the arguments of the hint."""
NO_OTHERS: Decoders = types.MappingProxyType({})


class MisfitError(ValueError):
    """A value that is not of the type that it is to have.

    Attributes:
        path: where it stands, as ``camera.fx``; what: what was expected there and what came.
    """

    def __init__(self, path: str, what: str) -> None:
        super().__init__(f"{path}: {what}")
        self.path, self.what = path, what

    @staticmethod
    def within(name: str, error: Exception) -> MisfitError:
        """The same, seen from what holds it under a name."""
        if isinstance(error, MisfitError):
            return MisfitError(f"{name}.{error.path}", error.what)
        return MisfitError(name, str(error))


def decode(value: Any, hint: Any, others: Decoders = NO_OTHERS) -> Any:
    """A value of the type that a hint names, from JSON types. Numbers stay as they were written.

    Raises ValueError where it is of another type; names the field, what was expected and what came.
    """
    if hint is Any:
        return value
    origin = typing.get_origin(hint)
    if origin in (types.UnionType, typing.Union):
        of = next(a for a in typing.get_args(hint) if a is not type(None))
        return None if value is None else decode(value, of, others)
    if origin is typing.Literal:
        return _choice(value, typing.get_args(hint))
    if origin is collections.abc.Mapping:
        if not isinstance(value, dict):
            raise ValueError(f"expected an object, got {brief(value)}")
        return value
    if origin is tuple:
        return _tuple(value, typing.get_args(hint), others)
    if origin in others:
        return others[origin](value, typing.get_args(hint))
    if dataclasses.is_dataclass(hint) and isinstance(hint, type):
        return _dataclass(value, hint, others)
    if isinstance(hint, type) and issubclass(hint, Enum):
        names = {member.name.lower(): member for member in hint}
        return names[_choice(value, names)]
    if hint is float and isinstance(value, str) and value in NOT_FINITE:
        return float(value)
    fits = isinstance(value, (int, float) if hint is float else hint)
    if not fits or (isinstance(value, bool) and hint is not bool):
        raise ValueError(f"expected {WORDS.get(hint, hint.__name__)}, got {brief(value)}")
    return value


def _choice(value: Any, choices: collections.abc.Collection[Any]) -> Any:
    if value not in choices:
        raise ValueError(f"expected one of {', '.join(map(str, choices))}, got {brief(value)}")
    return value


def _tuple(value: Any, hints: tuple[Any, ...], others: Decoders) -> tuple[Any, ...]:
    if not isinstance(value, list):
        raise ValueError(f"expected a list, got {brief(value)}")
    kinds = hints[:1] * len(value) if Ellipsis in hints else hints
    if len(kinds) != len(value):
        raise ValueError(f"expected {len(kinds)} items, got {brief(value)}")
    return tuple(decode(item, kind, others) for item, kind in zip(value, kinds, strict=True))


def _dataclass(value: Any, kind: type[Any], others: Decoders) -> Any:
    names = [field.name for field in dataclasses.fields(kind)]
    if not isinstance(value, dict) or sorted(value) != sorted(names):
        raise ValueError(f"expected {kind.__name__} with {', '.join(names)}, got {brief(value)}")
    return kind(**fields_of(value, kind, others))


def fields_of(value: Mapping[str, Any], kind: type[Any], others: Decoders = NO_OTHERS) -> dict[str, Any]:
    """The fields of a dataclass that JSON types tell, each of its type. Raises ValueError as :func:`decode` does."""
    hints, fields = typing.get_type_hints(kind), dict[str, Any]()
    for name, item in value.items():
        if name not in hints:
            raise ValueError(f"expected {', '.join(field.name for field in dataclasses.fields(kind))}, got {name!r}")
        try:
            fields[name] = decode(item, hints[name], others)
        except (ValueError, TypeError) as error:
            raise MisfitError.within(name, error) from None
    return fields


def brief(value: Any) -> str:
    text = f"the keys {', '.join(value)}" if isinstance(value, dict) else repr(value)
    return text if len(text) < 300 else text[:297] + "..."
