"""Encoding: values as JSON text, by one encoder for each type, made when the type is first met.

The text is that of ``json.dumps(plain(value))``, to the byte; ``plain`` says what it means, this is how it is fast. The
law is in tests/laws/board/test_laws_journal.py.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from enum import Enum
from json.encoder import encode_basestring_ascii
from math import inf, isfinite, nan
from operator import attrgetter, call
from typing import Any

Encoder = Callable[[Any], str]

NUMBERS = ("b", "i", "u", "f")
"""The kinds of array elements that JSON has a word for."""

FLOATS = frozenset((float,))

NOT_FINITE = frozenset(map(repr, (nan, inf, -inf)))
"""Floats that JSON has no word for; no encoder writes these without quotes."""

quoted: Encoder = encode_basestring_ascii
"""A text as JSON text."""


def plain(value: Any) -> Any:
    """A value as JSON types: dataclasses and mappings become objects, arrays lists, bytes their length and SHA-256.

    Raises:
        ValueError: a value without a fixed order or form.
    """
    if isinstance(value, Enum):
        return value.name.lower()
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if isfinite(value) else repr(value)
    if isinstance(value, bytes):
        return {"bytes": len(value), "sha256": hashlib.sha256(value).hexdigest()}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, tuple | list):
        return [plain(v) for v in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    raise ValueError(f"expected a value of plain data, got a {type(value).__name__}")


def encoded(value: Any) -> str:
    """A value as JSON text, without spaces.

    Raises:
        ValueError: as :func:`plain` does.
    """
    return ENCODERS[type(value)](value)


def _encoder_of(kind: type[Any]) -> Encoder:
    if kind in _EXACT:
        return _EXACT[kind]
    if dataclasses.is_dataclass(kind) and not issubclass(kind, _CHECKED_FIRST):
        return _dataclass_encoder(kind)
    return _array if hasattr(kind, "dtype") and not issubclass(kind, _CHECKED_FIRST) else _by_way_of_plain


class _Encoders(dict[type[Any], Encoder]):
    """Asked for a type that it does not have, it makes the encoder and keeps it: half the time of a cached function."""

    def __missing__(self, kind: type[Any]) -> Encoder:
        made = self[kind] = _encoder_of(kind)
        return made


ENCODERS: Mapping[type[Any], Encoder] = _Encoders()
"""How values of exactly this type are written; made once for each type."""


def _by_way_of_plain(value: Any) -> str:
    return json.dumps(plain(value), separators=(",", ":"), allow_nan=False)


def _array(value: Any) -> str:
    """Numbers in bulk; what is no number, or not finite, goes the long way."""
    if value.dtype.kind in NUMBERS:
        try:
            return json.dumps(value.tolist(), separators=(",", ":"), allow_nan=False)
        except ValueError:
            return _by_way_of_plain(value)
    return _by_way_of_plain(value)


def _float(value: float) -> str:
    return f"{value!r}" if isfinite(value) else f'"{value!r}"'


def _items(values: Iterable[Any]) -> str:
    if set(map(type, values)) == FLOATS:
        text = ",".join(map(float.__repr__, values))
        if "n" not in text:  # as in nan and inf
            return f"[{text}]"
    return f"[{','.join([ENCODERS[type(value)](value) for value in values])}]"


def _dataclass_encoder(kind: type[Any]) -> Encoder:
    """``{"first":...,"second":...}`` with the names written once."""
    names = [field.name for field in dataclasses.fields(kind)]
    form = "{" + ",".join(f"{quoted(name)}:%s" for name in names) + "}"
    if len(names) < 2:
        return lambda value: form % tuple([encoded(getattr(value, name)) for name in names])
    fields = attrgetter(*names)
    shapes: dict[tuple[type[Any], ...], tuple[tuple[Encoder, ...], bool]] = {}

    def encode(value: Any) -> str:
        """The encoders of all fields are found by the types of all fields at once: no step in Python for each."""
        held = fields(value)
        kinds = tuple(map(type, held))
        known = shapes.get(kinds)
        if known is None:
            found = tuple([float.__repr__ if kind is float else ENCODERS[kind] for kind in kinds])
            known = shapes[kinds] = found, float in kinds
        encoders, has_floats = known
        texts = tuple(map(call, encoders, held))
        if has_floats and not NOT_FINITE.isdisjoint(texts):
            texts = tuple([f'"{text}"' if text in NOT_FINITE else text for text in texts])
        return form % texts

    return encode


_EXACT: Mapping[type[Any], Encoder] = {
    str: quoted,
    int: int.__repr__,
    float: _float,
    bool: lambda value: "true" if value else "false",
    type(None): lambda _value: "null",
    tuple: _items,
    list: _items,
}
_CHECKED_FIRST = (Enum, int, str, float, bytes)
"""A class that is one of these is written as such, though it may be a dataclass as well."""
