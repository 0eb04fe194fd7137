"""Lights: what draws a building under lamps, sun and sky.

Light that is even is drawn as a building without ``[light]`` is. All else is drawn by an extra (``harvey.renderers``).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from sim.render.lighting import GAMMA, Lighting
from sim.render.mesh import FaceLike
from sim.render.renderer import Renderer
from world_models.plugins import RENDERERS_GROUP, list_absent, load_plugins

LIT = "lit"
"""The name of the renderers of buildings under light, as an entry point."""


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


@runtime_checkable
class LitRenderers(Protocol):
    """Renderers of buildings under light: an extra brings them."""

    def check(self, lighting: Lighting) -> None:
        """Raises ValueError, which says what to install, where this light cannot be drawn."""
        ...

    def build(self, faces: Sequence[FaceLike], lighting: Lighting, rooms: Sequence[Room], samples: int) -> Renderer:
        """A renderer of these faces under this light; the same for the same arguments.

        Args:
            rooms: in which lamps hang, whose floors can be shiny and whose walls can be coloured.
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
        return find_lit_renderers().build(tuple(faces), lighting, self.rooms, samples)
