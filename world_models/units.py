"""Units of files and output, and bounds of settings; inside everything is in metres and radians.

A number out of its bounds is an error that file readers can restate in the file's units.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, TypeVar

Value = TypeVar("Value", int, float)

FOOT_M = 0.3048
"""One foot [m]."""
INCH_M = 0.0254
"""One inch [m]."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """From ``low`` to ``high``, both included; with ``above``, without ``low`` itself."""

    low: float
    high: float
    above: bool = False

    def contains(self, value: float) -> bool:
        """Whether a number is within the bounds; NaN is not."""
        return (self.low < value if self.above else self.low <= value) and value <= self.high

    def describe(self, unit: float = 1.0) -> str:
        """The bounds in words, divided by ``unit``."""
        low, high = f"{self.low / unit:.6g}", f"{self.high / unit:.6g}"
        return f"above {low}, up to {high}" if self.above else f"from {low} to {high}"


class OutOfBoundsError(ValueError):
    """A setting outside its bounds.

    Attributes:
        key: name of the setting; bounds: what it was checked against.
    """

    def __init__(self, key: str, bounds: Bounds, value: float) -> None:
        super().__init__(f"expected {key} {bounds.describe()}, got {value:g}")
        self.key, self.bounds = key, bounds


def check_bounds(settings: Any, bounds: Mapping[str, Bounds]) -> None:
    """Raises OutOfBoundsError for the first attribute of ``settings`` outside its bounds."""
    for key, allowed in bounds.items():
        value = getattr(settings, key)
        if not allowed.contains(value):
            raise OutOfBoundsError(key, allowed, value)


def bounded(default: Value, low: float, high: float, *, above: bool = False) -> Value:
    """A field of a :class:`Bounded` settings class, with its :class:`Bounds`."""
    return field(default=default, metadata={"bounds": Bounds(low, high, above)})


def bounds_of(kind: type[Any]) -> Mapping[str, Bounds]:
    """The bounds of the fields of a settings class that have any, by name."""
    return {known.name: known.metadata["bounds"] for known in fields(kind) if "bounds" in known.metadata}


class Bounded:
    """A base of settings dataclasses whose fields have to be within their bounds: raises OutOfBoundsError."""

    __slots__ = ()

    def __post_init__(self) -> None:
        check_bounds(self, bounds_of(type(self)))
