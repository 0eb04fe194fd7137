"""Bounds of settings: between what a number must lie, told so that a reader of files can say it in their unit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Bounds:
    """From ``low`` to ``high``; ``above``: but not ``low`` itself."""

    low: float
    high: float
    above: bool = False

    def hold(self, value: float) -> bool:
        """Whether a number lies between; not a number never does."""
        return (self.low < value if self.above else self.low <= value) and value <= self.high

    def words(self, unit: float = 1.0) -> str:
        """In words, in units of so much."""
        low, high = f"{self.low / unit:.6g}", f"{self.high / unit:.6g}"
        return f"above {low}, up to {high}" if self.above else f"from {low} to {high}"


class OutOfBoundsError(ValueError):
    """A setting that is out of its bounds.

    Attributes:
        key: the setting's; bounds: its.
    """

    def __init__(self, key: str, bounds: Bounds, value: float) -> None:
        super().__init__(f"expected {key} {bounds.words()}, got {value:g}")
        self.key, self.bounds = key, bounds


def check_bounds(settings: Any, bounds: Mapping[str, Bounds]) -> None:
    """Raises OutOfBoundsError for the first attribute that is out of its bounds."""
    for key, allowed in bounds.items():
        value = getattr(settings, key)
        if not allowed.hold(value):
            raise OutOfBoundsError(key, allowed, value)
