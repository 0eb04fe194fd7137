"""Lamps: panels in rows below the ceilings of rooms, of which some are off."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from sim.render.lighting import Lighting
from sim.render.lights import Room

PANEL_M = (1.2, 0.3)
"""Length and width of a panel; its length is along the world's x axis where there is room, or else along y [m]."""
BELOW_CEILING_M = 0.02
"""Distance of a panel from its ceiling [m]."""
FROM_WALL_M = 0.15
"""Least distance of a panel from the walls [m]."""


@dataclass(frozen=True, eq=False)
class Lamp:
    """A panel that lights downwards.

    Attributes:
        polygon_world: (4, 3), counter-clockwise from below [m].
        radiosity: (3,) light that leaves each of its parts.
    """

    polygon_world: NDArray[np.float64]
    radiosity: NDArray[np.float64]


def hang_lamps(rooms: Sequence[Room], lighting: Lighting) -> tuple[Lamp, ...]:
    """The panels of all rooms, on or off; the same for the same arguments."""
    rng = np.random.default_rng([lighting.seed, 1])
    lamps: list[Lamp] = []
    for room in rooms:
        panels = _panels_in(room, lighting.lamp_spacing_m)
        per_panel = lighting.lamps * shapely.Polygon(room.outline_world).area / max(1, len(panels))
        radiosity = per_panel / math.prod(PANEL_M) * np.array(lighting.lamp_colour)
        are_on = rng.random(len(panels)) >= lighting.lamps_off
        lamps += [Lamp(panel, radiosity * is_on) for panel, is_on in zip(panels, are_on, strict=True)]
    return tuple(lamps)


def _panels_in(room: Room, spacing_m: float) -> list[NDArray[np.float64]]:
    """(4, 3) corners of each panel, counter-clockwise from below."""
    shape = shapely.Polygon(room.outline_world).buffer(-FROM_WALL_M)
    low, high = room.outline_world.min(axis=0), room.outline_world.max(axis=0)
    counts = [max(1, round(size / spacing_m)) for size in high - low]
    middles = [low + (high - low) * (np.array(at) + 0.5) / counts for at in np.ndindex(counts[0], counts[1])]
    panels = [panel for middle in middles if (panel := _panel_at(middle, shape)) is not None]
    height = np.full((4, 1), room.ceiling_m - BELOW_CEILING_M)
    return [np.hstack([panel, height]) for panel in panels]


def _panel_at(middle: NDArray[np.float64], room: shapely.Polygon) -> NDArray[np.float64] | None:
    """(4, 2) clockwise from above, which is counter-clockwise from below; None where it does not fit."""
    for size in (np.array(PANEL_M), np.array(PANEL_M[::-1])):
        panel = middle + 0.5 * size * np.array([(-1, -1), (-1, 1), (1, 1), (1, -1)])
        if room.contains(shapely.Polygon(panel)):
            return np.asarray(panel)
    return None
