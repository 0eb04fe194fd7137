"""What was observed, as values again: from the journal's JSON and, for pictures, the camera's bytes."""

from __future__ import annotations

import collections.abc
import dataclasses
import hashlib
import types
import typing
from collections.abc import Callable, Mapping
from typing import Any

from blackboard.change import Quiescence
from blackboard.effect import Effect, Post, Retract, Revise
from blackboard.encoding import NOT_FINITE
from blackboard.entry import Entry, Ref
from harvey.errors import BadInput
from harvey.run_files.records import EntryRecord
from logs.camera_file import Pictures
from world_models.entries.body import BodyFault, Frame, MotionReport, Recovery, RideReport
from world_models.entries.task import Command, Outcome, Resumed

OBSERVED: Mapping[str, type[Any]] = {
    t.__name__: t
    for t in (Command, MotionReport, RideReport, Frame, BodyFault, Recovery, Quiescence, Outcome, Resumed)
}
"""The types of value that come from outside."""

WORDS: Mapping[type[Any], str] = {
    float: "a number", int: "a whole number", str: "a text", bool: "true or false", dict: "an object", list: "a list"}
"""What a user calls a type."""


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


def effect_of(record: EntryRecord, frames: Mapping[int, bytes], current: Callable[[str], Entry[Any] | None]) -> Effect:
    """The effect that brought about an observed change.

    Args:
        frames: number -> JPEG bytes of the pictures.
        current: the current revision of an entry.

    Raises:
        BadInput: the value is of no type that is observed, its fields are not the type's, or its picture is lacking.
    """
    because = tuple(_ref(text) for text in record.because)
    if record.change == "Posted":
        return Post(value_of(record, frames), because)
    entry = current(record.id)
    if entry is None:
        raise BadInput(f"{record.ref}: expected an entry on the board, got none")
    if record.change == "Retracted":
        return Retract(entry, tuple(_ref(text) for text in record.retracted_because))
    return Revise(entry, value_of(record, frames), because)


def value_of(record: EntryRecord, frames: Mapping[int, bytes]) -> Any:
    """The value itself. Raises BadInput as :func:`effect_of` does."""
    if record.type not in OBSERVED:
        raise BadInput(f"{record.ref}: expected an observation ({', '.join(OBSERVED)}), got a {record.type}")
    value = dict(record.value) if isinstance(record.value, dict) else record.value
    if record.type == "Frame" and isinstance(value, dict):
        value["jpeg"] = _picture(record, value, frames)
    try:
        return decoded(value, OBSERVED[record.type])
    except (ValueError, TypeError) as error:
        raise BadInput(f"{record.ref}: {error}") from None


def _picture(record: EntryRecord, value: Mapping[str, Any], frames: Mapping[int, bytes]) -> bytes:
    """The bytes of a frame, after checking that they are those that the journal saw."""
    number, seen = value.get("number"), value.get("jpeg")
    if not isinstance(number, int) or number not in frames:
        raise BadInput(f"{record.ref}: expected picture {number} among those that were kept, which are {len(frames)}")
    jpeg = frames[number]
    if not isinstance(seen, dict) or hashlib.sha256(jpeg).hexdigest() != seen.get("sha256"):
        where = f"{frames.where(number)}: " if isinstance(frames, Pictures) else ""
        raise BadInput(f"{where}{record.ref}: expected the picture that the journal saw, got another one for number "
                       f"{number}")
    return jpeg


def decoded(value: Any, hint: Any) -> Any:
    """A value of the type that a hint names, from JSON types. Numbers stay as they were written.

    Raises:
        ValueError: it is of another type; names the field, what was expected and what came.
    """
    if hint is Any:
        return value
    origin = typing.get_origin(hint)
    if origin in (types.UnionType, typing.Union):
        return None if value is None else decoded(value, next(a for a in typing.get_args(hint) if a is not type(None)))
    if origin is collections.abc.Mapping:
        if not isinstance(value, dict):
            raise ValueError(f"expected an object, got {_brief(value)}")
        return value
    if origin is tuple:
        return _tuple(value, typing.get_args(hint))
    if dataclasses.is_dataclass(hint) and isinstance(hint, type):
        return _dataclass(value, hint)
    if hint is float and isinstance(value, str) and value in NOT_FINITE:
        return float(value)
    fits = isinstance(value, (int, float) if hint is float else hint)
    if not fits or (isinstance(value, bool) and hint is not bool):
        raise ValueError(f"expected {WORDS.get(hint, hint.__name__)}, got {_brief(value)}")
    return value


def _tuple(value: Any, hints: tuple[Any, ...]) -> tuple[Any, ...]:
    if not isinstance(value, list):
        raise ValueError(f"expected a list, got {_brief(value)}")
    kinds = hints[:1] * len(value) if Ellipsis in hints else hints
    if len(kinds) != len(value):
        raise ValueError(f"expected {len(kinds)} items, got {_brief(value)}")
    return tuple(decoded(item, kind) for item, kind in zip(value, kinds, strict=True))


def _dataclass(value: Any, kind: type[Any]) -> Any:
    names = [field.name for field in dataclasses.fields(kind)]
    if not isinstance(value, dict) or sorted(value) != sorted(names):
        raise ValueError(f"expected {kind.__name__} with {', '.join(names)}, got {_brief(value)}")
    return kind(**fields_of(value, kind))


def fields_of(value: Mapping[str, Any], kind: type[Any]) -> dict[str, Any]:
    """The fields of a dataclass that JSON types tell, each of its type. Raises ValueError as :func:`decoded` does."""
    hints, fields = typing.get_type_hints(kind), dict[str, Any]()
    for name, item in value.items():
        if name not in hints:
            raise ValueError(f"expected {', '.join(field.name for field in dataclasses.fields(kind))}, got {name!r}")
        try:
            fields[name] = decoded(item, hints[name])
        except (ValueError, TypeError) as error:
            raise MisfitError.within(name, error) from None
    return fields


def _brief(value: Any) -> str:
    text = f"the keys {', '.join(value)}" if isinstance(value, dict) else repr(value)
    return text if len(text) < 300 else text[:297] + "..."


def _ref(text: str) -> Ref:
    id, _, revision = text.rpartition(".")
    if not revision.isdecimal():
        raise BadInput(f"expected a revision as Goal-1.0, got {text!r}")
    return Ref(id, int(revision))
