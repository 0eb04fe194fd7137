"""Encoding: values as JSON types, so that equal values give equal text on every Python."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Mapping
from enum import Enum
from math import inf, isfinite, nan
from typing import Any

NOT_FINITE = frozenset(map(repr, (nan, inf, -inf)))
"""Floats that JSON has no word for; they are written as texts."""

FLOATS = frozenset((float,))


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
        if set(map(type, value)) == FLOATS and all(map(isfinite, value)):
            return list(value)
        return [plain(v) for v in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    raise ValueError(f"expected a value of plain data, got a {type(value).__name__}")
