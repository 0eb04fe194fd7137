"""Conceptual dependency (§3.3): ``(ptrans (locale (x,y,z)) (locale (x,y,z)))``, from place to place (Figure 17)."""

from __future__ import annotations

import re

from world_models.location import Place
from world_models.units import FOOT_M

_NUMBER = r"\s*([-+]?\d+(?:\.\d*)?)\s*"
_PLACE = rf"\(\s*([\w'-]+)\s+\({_NUMBER},{_NUMBER},{_NUMBER}\)\s*\)"
_GOAL = re.compile(rf"\s*\(\s*ptrans\s+{_PLACE}\s*{_PLACE}\s*\)\s*")


def parse_ptrans(text: str) -> tuple[Place, Place]:
    """From where to where; coordinates are feet in each locale's own frame, and z, on the floor, is not used.

    Raises:
        ValueError: the text has another form.
    """
    found = _GOAL.fullmatch(text)
    if found is None:
        raise ValueError(f"expected a goal like (ptrans (locale (x,y,z)) (locale (x,y,z))), got {text!r}")
    a, ax, ay, _, b, bx, by, _ = found.groups()
    return Place(a, float(ax) * FOOT_M, float(ay) * FOOT_M), Place(b, float(bx) * FOOT_M, float(by) * FOOT_M)
