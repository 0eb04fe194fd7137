"""Locales (§3.4): parcels of space with their own coordinate frames in a contained-by hierarchy.

With what is in and between them: things, doorways and links; where locales lie; and findings about a world.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from world_models.building.geometry.outlines import inside_polygon
from world_models.frames import Pose, Pose2, frozen

ROBOT_TOP_M = 1.4
"""A thing that begins higher than this above the floor is no obstacle."""

STEP_M = 0.03
"""A thing no higher than this is driven over."""

MAX_FLUSH_M = 0.06
"""A thing that protrudes from its wall by no more than this is no obstacle: the robot keeps clear of the wall."""

WORDS, WORDS_OF = "words", "words_of"
"""Properties of a locale: what people call it, and by name what they call its doors and things."""

EXTRA_KIND = "obstacle"
"""The kind of a thing that the file lacks."""


@dataclass(frozen=True, slots=True)
class Finding:
    """A fault of a world that could be read: where (file:line) and what."""

    source: str
    what: str

    def __str__(self) -> str:
        return f"{self.source}: {self.what}"


@dataclass(frozen=True, slots=True, eq=False)
class Thing:
    """Furniture, a pillar, a board on the wall.

    Attributes:
        name: unique in the world.
        locale: where it stands.
        kind: the part that it is made from.
        footprint_world: (4, 2) rectangle on the floor round all of it, or round what the robot could hit [m]; a
            polygon (k, 2) where the file lacks it.
        low_m, high_m: its vertical extent above the floor.
        protrusion_m: how far it protrudes from its wall; ``None`` for a free-standing thing.
        source: file:line where it is placed.
    """

    name: str
    locale: str
    kind: str
    footprint_world: NDArray[np.float64]
    low_m: float
    high_m: float
    protrusion_m: float | None
    source: str

    @property
    def is_obstacle(self) -> bool:
        """Whether the robot could hit it."""
        is_flush = self.protrusion_m is not None and self.protrusion_m <= MAX_FLUSH_M
        return self.low_m < ROBOT_TOP_M and self.high_m > STEP_M and not is_flush


@dataclass(frozen=True, eq=False)
class Locale:
    """A parcel of space with its own coordinate frame (§3.4, Figure 5).

    Attributes:
        name: unique in the world.
        kind: laboratory, hallway, office, floor, building, ...
        parent: the locale that contains it; ``None`` for the root.
        frame: parent_from_locale.
        outline: (k, 2) free extent on the floor, counter-clockwise, in its own frame [m].
        height_m: height of the ceiling in its own frame.
        properties: other properties of the world file, by name.
        source: file:line of its description.
        floor_m: height of the floor in its own frame; not 0 only for a locale that contains others.
        survey_m, survey_rad: standard deviations of its frame's position and direction in its container.
    """

    name: str
    kind: str
    parent: str | None
    frame: Pose
    outline: NDArray[np.float64]
    height_m: float
    properties: Mapping[str, Any] = field(default_factory=dict)
    source: str = ""
    floor_m: float = 0.0
    survey_m: float = 0.0
    survey_rad: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "outline", frozen(self.outline, (None, 2)))

    def contains(self, point: Any, margin_m: float = 0.0) -> bool:
        """Whether a point (2,) or (3,) [m, own frame] lies in it or at most ``margin_m`` outside; borders count."""
        p = np.asarray(point, float)
        if p.size == 3 and not self.floor_m - margin_m - 1e-9 <= p[2] <= self.height_m + margin_m + 1e-9:
            return False
        return inside_polygon(p[:2], self.outline, margin_m)


@dataclass(frozen=True, eq=False)
class Doorway:
    """An opening through the wall between two locales.

    Attributes:
        name: unique in the world.
        between: the two locales.
        thresholds_world: (2, 2, 2) [m]; ``thresholds_world[i]`` are the feet of the two jambs on the outline of
            ``between[i]``, left jamb first as seen from inside that locale.
        height_m: height of the opening.
        source: file:line of its description.
    """

    name: str
    between: tuple[str, str]
    thresholds_world: NDArray[np.float64]
    height_m: float
    source: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "thresholds_world", frozen(self.thresholds_world, (2, 2, 2)))

    @property
    def width_m(self) -> float:
        return float(np.linalg.norm(self.thresholds_world[0, 1] - self.thresholds_world[0, 0]))

    @property
    def depth_m(self) -> float:
        """Thickness of its wall."""
        ends = self.thresholds_world.mean(axis=1)
        return float(np.linalg.norm(ends[1] - ends[0]))

    @property
    def centre_world(self) -> NDArray[np.float64]:
        """(2,) middle of the opening, half-way through the wall [m]."""
        return np.asarray(self.thresholds_world.mean(axis=(0, 1)))

    def other(self, locale: str) -> str:
        """The locale on the other side."""
        return self.between[1 - self._side(locale)]

    def threshold_of(self, locale: str) -> NDArray[np.float64]:
        """(2, 2) feet of its left and right jamb on the outline of ``locale`` [m, world]. Raises ValueError."""
        return np.asarray(self.thresholds_world[self._side(locale)])

    def outward_from(self, locale: str) -> NDArray[np.float64]:
        """(2,) unit direction on the floor out of ``locale`` through the doorway [world]."""
        left, right = self.threshold_of(locale)
        along = (right - left) / np.linalg.norm(right - left)
        return np.array([-along[1], along[0]])

    def pose_from(self, locale: str) -> Pose2:
        """The pose in the middle of the threshold of ``locale``, facing out of it [m, world]."""
        x, y = self.threshold_of(locale).mean(axis=0)
        ahead = self.outward_from(locale)
        return Pose2(float(x), float(y), float(np.arctan2(ahead[1], ahead[0])))

    def _side(self, locale: str) -> int:
        if locale not in self.between:
            raise ValueError(f"expected one of {self.between}, got {locale!r}")
        return self.between.index(locale)


@dataclass(frozen=True, eq=False)
class Link:
    """A passage between two locales that share no wall: an elevator from landing to landing, a flight of stairs.

    Attributes:
        name: unique in the world.
        kind: elevator or stairs.
        between: the two locales.
        stops_world: (2, 3) x, y, heading of the robot in each locale at the start or end of the ride [m, rad].
        source: file:line of its description.
    """

    name: str
    kind: str
    between: tuple[str, str]
    stops_world: NDArray[np.float64]
    source: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "stops_world", frozen(self.stops_world, (2, 3)))

    def other(self, locale: str) -> str:
        """The locale at the other end."""
        return self.between[1 - self.between.index(locale)]

    def stop_of(self, locale: str) -> NDArray[np.float64]:
        """(3,) x, y [m] and heading [rad] of the stop in one of the two locales, world frame."""
        return np.asarray(self.stops_world[self.between.index(locale)])


Passage = Doorway | Link


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

    def reaches_height(self, z_m: float, margin_m: float) -> bool:
        """Whether it, with all that it contains, reaches a height within a margin [m, world]."""
        return self.reach[2] - margin_m <= z_m <= self.reach[5] + margin_m


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
