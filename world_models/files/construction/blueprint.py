"""What a world file says, checked and in metres, before the geometer makes surfaces of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from world_models.building.regions import Finish
from world_models.building.solids import Box
from world_models.frames import Pose


@dataclass(frozen=True)
class RoomLook:
    """The finishes of a room; ``baseboard`` and ``moulding`` may be absent, the ``ceiling`` under the sky."""

    walls: Mapping[str, Finish]
    floor: Finish
    ceiling: Finish | None
    baseboard: Finish | None
    moulding: Finish | None


@dataclass(frozen=True, eq=False)
class LocaleSpec:
    """A locale as described; ``outline`` (k, 2) [m] is ``None`` for one that only contains others.

    ``wall_names`` has one name for each side of the outline, the side from vertex i to vertex i + 1;
    ``wall_heights_m`` the heights of those that are lower than the room.
    """

    name: str
    kind: str
    parent: str
    frame: Pose
    outline: NDArray[np.float64] | None
    wall_names: tuple[str, ...]
    height_m: float
    look: RoomLook
    properties: Mapping[str, Any]
    source: str
    survey_m: float = 0.0
    survey_rad: float = 0.0
    wall_heights_m: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class DoorSpec:
    """A door in a wall of ``between[0]``, centred ``along_m`` of that locale's frame; closed unless ``is_open``.

    ``between`` has a second name where it leads to another modelled locale. ``panel`` stands on the closed leaf.
    """

    name: str
    between: tuple[str, ...]
    wall: str
    along_m: float
    width_m: float
    height_m: float
    is_open: bool
    frame: Finish
    leaf: Finish
    threshold: Finish
    panel: tuple[Box, ...]
    source: str


@dataclass(frozen=True, eq=False)
class ThingSpec:
    """Furniture and the like: boxes placed in a locale, either freely or against a wall.

    ``wall`` with ``along_m`` (as for doors) and ``up_m``, or ``locale_from_part``.
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
class Blueprint:
    """A whole world file."""

    name: str
    source: str
    locales: Mapping[str, LocaleSpec]
    doors: tuple[DoorSpec, ...]
    things: tuple[ThingSpec, ...] = field(default=())
    links: tuple[LinkSpec, ...] = field(default=())
