"""Numbers with units, places and names in plain words: the vocabulary of recordings, explanations and reports."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

SMALL_M, TINY_M = 0.1, 0.01
"""A length up to the first is given in millimetres, below the second in tenths of them."""
STRAIGHT_RAD = math.radians(0.05)
"""A smaller angle is given as none."""
MAX_FIELDS_TEXT = 160
"""Length of the text that tells a value of unknown kind by its fields [characters]."""

PURPOSES: Mapping[str, str] = {
    "track": "to follow landmarks", "milestone": "to verify a milestone", "probe": "to find out where the robot is",
}
"""What a picture is taken for, by the purpose that the board names."""
UNITS: Mapping[str, str] = {
    "_m": "m", "_px": "px", "_s": "s", "_hz": "Hz", "_m_per_s": "m/s", "_kg": "kg", "_v": "V", "_percent": "%",
}
"""The unit of a field, by the end of its name; angles are given in degrees."""
PROPER_NAMES: Mapping[str, str] = {"med_r_and_t": "Med-R-and-T"}


Number = float | str
"""A number; a journal writes one that is not finite as text."""


def by_numbers(path: Path) -> tuple[list[tuple[int, str]], str]:
    """Sorts files whose names have numbers in them: 2 before 10."""
    parts = re.split(r"(\d+)", path.name)
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts], path.name


def number(value: Any) -> float:
    """A number as a journal has it. Raises ValueError for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"expected a number, got {value!r}")
    return float(value)


def metres(length_m: Number) -> str:
    """``0.61 m``, ``33 mm`` or ``2.4 mm``."""
    length = number(length_m)
    if abs(length) > SMALL_M:
        return f"{length:.2f} m"
    return f"{1e3 * length:.{0 if abs(length) >= TINY_M else 1}f} mm"


def degrees(angle_rad: Number) -> str:
    """``3.1 degrees``; -0.0 prints as 0.0."""
    return f"{round(math.degrees(number(angle_rad)), 1) + 0.0:.1f} degrees"


def turn(angle_rad: Number) -> str:
    """A counter-clockwise angle as a turn to one side: ``3.1 degrees left``."""
    angle = number(angle_rad)
    return f"{degrees(abs(angle))} {'left' if angle >= 0.0 else 'right'}"


def bearing(angle_rad: Number) -> str:
    """A direction from the robot's heading: ``straight ahead`` or ``31.0 degrees left of ahead``."""
    return "straight ahead" if abs(number(angle_rad)) < STRAIGHT_RAD else f"{turn(angle_rad)} of ahead"


def motion(turn_rad: float, move_m: float) -> str:
    """``turn 3.1 degrees left and move 0.61 m ahead``; a part that is zero is left out."""
    parts = [f"turn {turn(turn_rad)}"] * (abs(turn_rad) > 1e-6)
    parts += [f"move {metres(move_m)} ahead"] * (abs(move_m) > 1e-6)
    return " and ".join(parts) or "stand still"


def bend(curvature_per_m: float) -> str:
    """A curvature as people see it: ``0.52 degrees a metre to the left``."""
    side = "left" if curvature_per_m >= 0.0 else "right"
    return f"{abs(math.degrees(curvature_per_m)):.2f} degrees a metre to the {side}"


def point(x_m: Number, y_m: Number) -> str:
    """``(3.96, 3.66) m``."""
    return f"({number(x_m):.2f}, {number(y_m):.2f}) m"


def quantity(value: Number, unit: str) -> str:
    """A number in a unit that the board names; lengths and angles in the units that people use."""
    if unit == "m":
        return metres(value)
    if unit == "px":
        return f"{number(value):.2f} px"
    return degrees(value) if unit == "rad" else f"{number(value):.3g} {unit}".rstrip()


def size(magnitude: Number, unit: str) -> str:
    """How large a discrepancy is; an infinite one was too large to be measured."""
    return quantity(magnitude, unit) if math.isfinite(number(magnitude)) else "too large to be measured"


def sigma(covariance: Sequence[Sequence[float]]) -> str:
    """The largest standard deviation of the place and that of the heading, of (3, 3) over (x, y, heading)."""
    (a, b, _), (_, d, _), (_, _, heading) = covariance
    place = (a + d) / 2.0 + math.hypot((a - d) / 2.0, b)
    return f"sigma {metres(math.sqrt(max(0.0, place)))}, {degrees(math.sqrt(max(0.0, heading)))}"


def count(number: int, one: str, many: str = "") -> str:
    """``1 line``, ``2 lines``."""
    return f"{number} {one if number == 1 else many or one + 's'}"


def purpose(name: str) -> str:
    """What a picture is taken for."""
    return PURPOSES.get(name, f"for {name}" if name else "for no purpose")


def source(name: str) -> str:
    """A knowledge source's name as people write it."""
    return PROPER_NAMES.get(name, name.replace("_", " "))


def landmark(name: str) -> str:
    """``hallway/pillar-4`` as ``pillar-4 of hallway``."""
    locale, _, thing = name.rpartition("/")
    return f"{thing} of {locale}" if locale else thing


def without_locale(name: str) -> str:
    """``hallway/pillar-4`` as ``pillar-4``, where the locale is clear."""
    return name.rpartition("/")[2]


def listed(items: Sequence[Any], most: int = 3) -> str:
    """``a, b and c``; ``a, b, c and 4 more`` where there are more than ``most``."""
    texts = [str(item) for item in items]
    if len(texts) > most:
        return f"{', '.join(texts[:most])} and {len(texts) - most} more"
    return " and ".join([", ".join(texts[:-1]), texts[-1]] if len(texts) > 1 else texts)


def grouped(parts: Iterable[str]) -> list[str]:
    """Equal parts in a row become one, with how often it came: ``a look (3 times)``."""
    runs = [(part, len(list(same))) for part, same in groupby(parts)]
    return [f"{part} ({times} times)" if times > 1 else part for part, times in runs]


def short(text: str, most: int = 34) -> str:
    """The beginning of a text that may be too long for its place."""
    return text if len(text) <= most else text[: most - 1] + "…"


def sentence(value: Any) -> str:
    """What a value on the board says, in one sentence without a full stop.

    A kind of entry says it by its method ``sentence``; one that has none is given by its fields and their units.
    """
    say = getattr(value, "sentence", None)
    return str(say()) if callable(say) else fields({f.name: getattr(value, f.name) for f in dataclasses.fields(value)})


def brief(value: Any) -> str:
    """The first clause of the sentence, up to its semicolon: what a line of the recording has room for."""
    return sentence(value).partition(";")[0]


def fields(values: Any) -> str:
    """Fields by name, numbers with the unit that the name ends in: ``left = 3.45 s``."""
    items = values.items() if isinstance(values, Mapping) else [("value", values)]
    return short(", ".join(_field(str(key), item) for key, item in items) or "no fields", MAX_FIELDS_TEXT)


def _field(name: str, value: Any) -> str:
    if isinstance(value, float | np.floating):
        for end, unit in sorted(UNITS.items(), key=lambda pair: -len(pair[0])):
            if name.endswith(end):
                return f"{name.removesuffix(end).replace('_', ' ')} = {value:.4g} {unit}"
        if name.endswith("_rad"):
            return f"{name.removesuffix('_rad').replace('_', ' ')} = {degrees(float(value))}"
        return f"{name.replace('_', ' ')} = {value:.4g}"
    return f"{name.replace('_', ' ')} = {value}"
