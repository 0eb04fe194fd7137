"""Where locales lie: a rectangle round each one, and a box round all that it contains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from world_models.building.locales import Locale
from world_models.frames import Pose

Rectangle = tuple[float, float, float, float]
"""x0, y0, x1, y1 [m, world]."""

Box = tuple[float, float, float, float, float, float]
"""x0, y0, z0, x1, y1, z1 [m, world]."""


@dataclass(frozen=True, slots=True)
class LocaleExtent:
    """Where a locale lies.

    Attributes:
        name: of the locale.
        number: its place in the order of the world's file; the root's is 0.
        is_room: whether it contains no other locale.
        rectangle: round its outline on the plan, enlarged by a micrometre.
        reach: round it and all locales that it contains, from the lowest floor to the highest ceiling.
    """

    name: str
    number: int
    is_room: bool
    rectangle: Rectangle
    reach: Box

    def is_near(self, x_m: float, y_m: float, margin_m: float) -> bool:
        """Whether its rectangle, grown by a margin, holds a point [m, world]."""
        x0, y0, x1, y1 = self.rectangle
        return x0 - margin_m <= x_m <= x1 + margin_m and y0 - margin_m <= y_m <= y1 + margin_m

    def reaches(self, x_m: float, y_m: float, margin_m: float) -> bool:
        """Whether its reach on the plan, grown by a margin, holds a point [m, world].

        If not, then neither it nor any locale that it contains is near the point.
        """
        x0, y0, _, x1, y1, _ = self.reach
        return x0 - margin_m <= x_m <= x1 + margin_m and y0 - margin_m <= y_m <= y1 + margin_m


def bounding_box(locale: Locale, world_from_locale: Pose) -> Box:
    """The box round a locale, without what it contains: its outline enlarged by a micrometre, floor to ceiling."""
    flat = world_from_locale.apply(np.column_stack([locale.outline, np.zeros(len(locale.outline))]))[:, :2]
    (x0, y0), (x1, y1) = (flat.min(axis=0) - 1e-6).tolist(), (flat.max(axis=0) + 1e-6).tolist()
    base = float(world_from_locale.translation[2])
    return x0, y0, base + locale.floor_m, x1, y1, base + locale.height_m


def bounding_rectangle(box: Box) -> Rectangle:
    """A box on the plan."""
    return box[0], box[1], box[3], box[4]


def compute_reaches(parents: Mapping[str, str | None], boxes: Mapping[str, Box]) -> dict[str, Box]:
    """For each locale the box round it and all locales that it contains.

    Args:
        parents: container of each locale; None for the root.
        boxes: of each locale without what it contains.
    """
    reaches = dict(boxes)
    for name, box in boxes.items():
        above = parents[name]
        while above is not None:
            reaches[above] = _join(reaches[above], box)
            above = parents[above]
    return reaches


def _join(one: Box, other: Box) -> Box:
    return (min(one[0], other[0]), min(one[1], other[1]), min(one[2], other[2]),
            max(one[3], other[3]), max(one[4], other[4]), max(one[5], other[5]))
