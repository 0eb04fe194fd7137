"""A world as its file describes it, checked and in metres, before surfaces are built."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from world_models.building.geometry.faces import Finish
from world_models.building.geometry.solids import Box
from world_models.frames import Pose

DOOR_SIZES_M, ROOM_HEIGHTS_M = (0.1, 20.0), (0.1, 1000.0)
"""Least and most width and height of a door, and height of a room, that a world file may have [m]."""


@dataclass(frozen=True)
class RoomFinishes:
    """The finishes of a room, those of the walls by name; ``None`` for parts that it lacks, as a ceiling outdoors."""

    walls: Mapping[str, Finish]
    floor: Finish
    ceiling: Finish | None
    baseboard: Finish | None
    moulding: Finish | None


@dataclass(frozen=True, eq=False)
class LocaleSpec:
    """A locale as described.

    Attributes:
        parent: name of its container.
        frame: parent_from_locale.
        outline: (k, 2) counter-clockwise [m, own frame]; ``None`` for a locale that only contains others.
        wall_names: of each side of the outline; side i runs from vertex i to vertex i + 1.
        survey_m, survey_rad: standard deviations of the frame's position and direction in its container.
        wall_heights_m: of walls lower than the room, by name.
    """

    name: str
    kind: str
    parent: str
    frame: Pose
    outline: NDArray[np.float64] | None
    wall_names: tuple[str, ...]
    height_m: float
    finishes: RoomFinishes
    properties: Mapping[str, Any]
    source: str
    survey_m: float = 0.0
    survey_rad: float = 0.0
    wall_heights_m: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class DoorSpec:
    """A door as described; closed unless ``is_open``.

    Attributes:
        between: the locale in whose wall it is, and the modelled locale beyond, if there is one.
        wall: name of the wall of ``between[0]``.
        along_m: position of its centre along that wall, in the frame of ``between[0]``.
        casing: finish of the boards round it (the door's frame); None: a plain opening in the wall.
        leaf, threshold: finishes of the leaf and the threshold.
        panel: boxes on the closed leaf.
    """

    name: str
    between: tuple[str, ...]
    wall: str
    along_m: float
    width_m: float
    height_m: float
    is_open: bool
    casing: Finish | None
    leaf: Finish
    threshold: Finish
    panel: tuple[Box, ...]
    source: str


@dataclass(frozen=True, eq=False)
class ThingSpec:
    """A thing as described: boxes in a locale, either free (``locale_from_part``) or against a wall.

    Attributes:
        kind: the part that it is made from.
        wall, along_m, up_m: name of the wall, position along it (as for doors) and height above the floor.
    """

    name: str
    locale: str
    kind: str
    boxes: tuple[Box, ...]
    source: str
    locale_from_part: Pose | None = None
    wall: str | None = None
    along_m: float = 0.0
    up_m: float = 0.0


@dataclass(frozen=True)
class LinkSpec:
    """An elevator or a flight of stairs; each stop is x, y [m] and heading [rad] in the frame of its locale."""

    name: str
    kind: str
    between: tuple[str, str]
    stops: tuple[tuple[float, float, float], tuple[float, float, float]]
    source: str


@dataclass(frozen=True, eq=False)
class WorldSpec:
    """A whole world file; ``name`` is the root locale's."""

    name: str
    source: str
    locales: Mapping[str, LocaleSpec]
    doors: tuple[DoorSpec, ...]
    things: tuple[ThingSpec, ...] = ()
    links: tuple[LinkSpec, ...] = ()
