"""Goals in conceptual-dependency form (§3.3, Figure 17): ``(ptrans (locale (x,y,z)) (locale (x,y,z)))``."""

from __future__ import annotations

import re

from world_models.entries.location import Place
from world_models.units import FOOT_M

MAX_COORDINATE_FT = 1e6
_NUMBER = r"\s*([-+]?\d+(?:\.\d*)?)\s*"
_PLACE = rf"\(\s*([\w'-]+)\s+\({_NUMBER},{_NUMBER},{_NUMBER}\)\s*\)"
_DESTINATION = re.compile(rf"\s*{_PLACE}\s*")
_GOAL = re.compile(rf"\s*\(\s*ptrans\s+{_PLACE}\s*{_PLACE}\s*\)\s*")


def parse_ptrans(text: str) -> tuple[Place, Place]:
    """Origin and destination; coordinates are feet in each locale's own frame, and z is 0, the floor.

    Raises:
        ValueError: the text has another form, z is not 0, or a coordinate is above MAX_COORDINATE_FT.
    """
    match = _GOAL.fullmatch(text)
    if match is None:
        raise ValueError(f"expected a goal like (ptrans (locale (x,y,z)) (locale (x,y,z))), got {text!r}")
    a, ax, ay, az, b, bx, by, bz = match.groups()
    return _place(a, ax, ay, az), _place(b, bx, by, bz)


def parse_place(text: str) -> Place:
    """One place, as ``(library (6,10,0))``. Raises ValueError as :func:`parse_ptrans` does."""
    match = _DESTINATION.fullmatch(text)
    if match is None:
        raise ValueError(f"expected a place like (library (6,10,0)), got {text!r}")
    locale, x, y, z = match.groups()
    return _place(locale, x, y, z)


def _place(locale: str, x: str, y: str, z: str) -> Place:
    if float(z) != 0.0:
        raise ValueError(f"expected z = 0, the floor of {locale}, got {z}")
    if max(abs(float(x)), abs(float(y))) > MAX_COORDINATE_FT:
        raise ValueError(f"expected coordinates of at most {MAX_COORDINATE_FT:g} ft, got ({x}, {y})")
    return Place(locale, float(x) * FOOT_M, float(y) * FOOT_M)
