"""One number of a method: its default, its unit, what it is and where it comes from.

Each room has one frozen dataclass of such numbers in this folder. ``harvey settings`` prints them all, and
``--set ROOM.NAME=VALUE`` replaces one.
"""

from __future__ import annotations

from dataclasses import field
from math import inf
from typing import Any

Value = float | tuple[float, ...] | str
"""Of a setting: a number (or ``True`` and ``False``), several numbers, or a name."""


def setting(
    default: Value, unit: str, what: str, source: str, *, most: float = inf, choices: tuple[str, ...] = ()
) -> Any:
    """A field of a settings dataclass.

    Args:
        default: a whole number where only whole numbers make sense; a tuple where there are several; a name.
        unit: ``px``, ``m``, ``rad``, ``s``, ``1`` for a ratio or a probability, ``count``, ``name``, ``yes/no``.
        what: one sentence, without the unit.
        source: section or equation of the paper, or the experiment that chose it, or "engineering judgement".
        most: largest value, where something else does not allow more.
        choices: of a name.
    """
    details = {"unit": unit, "what": what, "source": source, "most": most, "choices": choices}
    return field(default=default, metadata=details)
