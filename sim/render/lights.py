"""Lights: lamps in rows below the ceilings of rooms, and what draws a building under them.

Light that is even is drawn as a building without ``[light]`` is. All else is drawn by an extra (``harvey.renderers``).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import shapely
from numpy.typing import NDArray

from sim.render.lighting import GAMMA, Lighting
from sim.render.mesh import FaceLike
from sim.render.renderer import Renderer
from world_models.plugins import RENDERERS_GROUP, list_absent, load_plugins

LIT = "lit"
"""The name of the renderers of buildings under light, as an entry point."""
PANEL_M = (1.2, 0.3)
"""Length and width of a panel; its length is along the world's x axis where there is room, or else along y [m]."""
BELOW_CEILING_M = 0.02
"""Distance of a panel from its ceiling [m]."""
FROM_WALL_M = 0.15
"""Least distance of a panel from the walls [m]."""


@dataclass(frozen=True, eq=False)
class Room:
    """What lamps need of a room.

    Attributes:
        outline_world: (k, 2) of its floor [m].
        floor_m, ceiling_m: heights in the world frame.
    """

    outline_world: NDArray[np.float64]
    floor_m: float
    ceiling_m: float


@dataclass(frozen=True, eq=False)
class Lamp:
    """A panel that lights downwards.

    Attributes:
        polygon_world: (4, 3), counter-clockwise from below [m].
        radiosity: (3,) light that leaves each of its parts.
    """

    polygon_world: NDArray[np.float64]
    radiosity: NDArray[np.float64]


@runtime_checkable
class LitRenderers(Protocol):
    """Renderers of buildings under light: an extra brings them."""

    def check(self, lighting: Lighting) -> None:
        """Raises ValueError, which says what to install, where this light cannot be drawn."""
        ...

    def build(self, faces: Sequence[FaceLike], lighting: Lighting, rooms: Sequence[Room], lamps: Sequence[Lamp],
              samples: int) -> Renderer:
        """A renderer of these faces under this light; the same for the same arguments.

        Args:
            rooms: whose floors can be shiny and whose walls can be coloured.
            lamps: all that hang in them; those that are off have no radiosity.
            samples: per pixel.

        Raises:
            ValueError: a region or the number of samples is bad.
        """
        ...


def check_light(lighting: Lighting) -> None:
    """Raises ValueError, which says what to install, where nothing that is installed can draw this light."""
    if lighting.uneven:
        if needs := list_absent(RENDERERS_GROUP).get(LIT):
            raise ValueError(f"with {', '.join(lighting.uneven)} it needs {needs}")
        find_lit_renderers().check(lighting)


def find_lit_renderers() -> LitRenderers:
    """Those that are installed. Raises KeyError where none are, and PluginError."""
    found: LitRenderers = load_plugins(RENDERERS_GROUP, LitRenderers, LIT)[LIT]
    return found


@dataclass(frozen=True, eq=False)
class Lights:
    """What lights a building: makes renderers of its faces.

    Attributes:
        lighting: the light.
        rooms: where lamps hang, and which floors there are.
    """

    lighting: Lighting
    rooms: tuple[Room, ...] = ()

    def renderer(self, faces: Iterable[FaceLike], samples: int = 8) -> Renderer:
        """The renderer of these faces under this light. Raises ValueError for a bad region or number of samples."""
        lighting = self.lighting
        if not lighting.uneven:
            return Renderer.of_faces(faces, samples, lighting.flat ** (1.0 / GAMMA))
        lamps = hang_lamps(self.rooms, lighting) if lighting.lamps > 0.0 else ()
        return find_lit_renderers().build(tuple(faces), lighting, self.rooms, lamps, samples)


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
