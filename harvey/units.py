"""Numbers with units, as people read them."""

from __future__ import annotations

import math
from typing import Any

INCH_M = 0.0254


def number(value: Any) -> float:
    """A number of the journal; what is not finite is written as text there. Raises ValueError for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"expected a number, got {value!r}")
    return float(value)


def metres(value: Any) -> str:
    """A length: millimetres up to 10 cm, metres beyond."""
    m = number(value)
    return f"{m * 1000.0:.0f} mm" if abs(m) <= 0.1 else f"{m:.2f} m"


def degrees(value: Any) -> str:
    """An angle, never as minus nought."""
    return f"{round(math.degrees(number(value)), 1) + 0.0:.1f} degrees"


def turn(value: Any) -> str:
    """A counter-clockwise angle as a turn to one side."""
    deg = math.degrees(number(value))
    return f"{abs(deg):.1f} degrees {'left' if deg >= 0 else 'right'}"


def point(x_m: Any, y_m: Any) -> str:
    return f"({number(x_m):.2f}, {number(y_m):.2f}) m"


def quantity(value: Any, unit: str) -> str:
    """A number in a unit that the journal names; lengths and angles in the units that people use."""
    if unit == "m":
        return metres(value)
    if unit == "px":
        return f"{number(value):.2f} px"
    return degrees(value) if unit == "rad" else f"{number(value):.3g} {unit}".rstrip()


def count(n: int, one: str, many: str = "") -> str:
    """``1 line``, ``2 lines``."""
    return f"{n} {one if n == 1 else many or one + 's'}"
