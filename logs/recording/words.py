"""Numbers, places and names in plain words, the same wherever the recorder speaks."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby

from world_models.entries.location import Place

SMALL_M, TINY_M = 0.1, 0.01
"""A length below these is told in millimetres, and in tenths of them."""

PROPER: Mapping[str, str] = {"med_r_and_t": "Med-R-and-T"}


def metres(length_m: float) -> str:
    """``0.61 m``, or ``33 mm`` where it is small."""
    if abs(length_m) >= SMALL_M:
        return f"{length_m:.2f} m"
    return f"{1e3 * length_m:.{0 if abs(length_m) >= TINY_M else 1}f} mm"


def degrees(angle_rad: float) -> str:
    """``3.1°``."""
    return f"{math.degrees(angle_rad):.1f}°"


def motion(turn_rad: float, move_m: float) -> str:
    """``turn 3.1° left, drive 0.61 m``; what is nought is left out."""
    turn = f"turn {degrees(abs(turn_rad))} {'left' if turn_rad > 0 else 'right'}" if abs(turn_rad) > 1e-4 else ""
    drive = f"drive {metres(move_m)}" if move_m > 0 else ""
    return ", ".join(part for part in (turn, drive) if part) or "stand still"


def place(where: Place) -> str:
    """``allens-office (3.96, 3.66) m``."""
    return f"{where.locale} ({where.x_m:.2f}, {where.y_m:.2f}) m"


def pixels(value: float) -> str:
    """``4.7 px``."""
    return f"{value:.1f} px"


def count(number: int, noun: str) -> str:
    """``1 line``, ``2 lines``."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def expert(name: str) -> str:
    """A knowledge source's name for people."""
    return PROPER.get(name, name.replace("_", " "))


def nearby(name: str) -> str:
    """A landmark's name without its locale."""
    return name.rpartition("/")[2]


def listed(names: Sequence[str], most: int = 4) -> str:
    """The first names, and how many more."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(map(nearby, names[:most])) + more


def numerous(parts: Iterable[str]) -> list[str]:
    """The same part said several times in a row is said once, with how often."""
    runs = [(part, len(list(same))) for part, same in groupby(parts)]
    return [f"{part} ({times} times)" if times > 1 else part for part, times in runs]


def short(text: str, most: int = 34) -> str:
    """The beginning of a text that may be too long for its place."""
    return text if len(text) <= most else text[: most - 1] + "…"
