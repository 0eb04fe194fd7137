"""Faces (§3.4, Figure 6): planar patches that bound locales, of type barrier or doorway, and the regions on them."""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from world_models.frames import frozen

TEXTURES = ("plain", "speckle", "wood", "brick", "tiles", "carpet", "stripes", "poster")

LUMA = np.array([0.299, 0.587, 0.114])
"""Weights of red, green and blue in a grey image."""

AMBIENT = 0.6
"""Brightness of a white surface parallel to the light."""
LAMP = np.array([0.12, 0.04, 0.18])
"""Direction of the building's light: from above and a little from the east. It decides which creases show."""
LAMP_DIRECTION = LAMP / np.linalg.norm(LAMP)


@dataclass(frozen=True, slots=True)
class Finish:
    """Appearance of a surface.

    Its colour (red, green, blue) in 0..1 (NaN: unknown), one of :data:`TEXTURES`, size of its cells [m].
    """

    colour: tuple[float, float, float]
    texture: str = "plain"
    texture_scale_m: float = 0.1

    @property
    def luma(self) -> float:
        return float(np.dot(LUMA, self.colour))


UNKNOWN = Finish((math.nan, math.nan, math.nan))
"""Of a surface whose colour the model does not know: it hides what is behind it, and no colour of it is expected."""


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """An area of a face with uniform appearance.

    Attributes:
        name: unique in the world.
        polygon_world: (k, 3) convex and flat, counter-clockwise as seen from its visible side [m].
        colour: (red, green, blue) in 0..1; NaN: unknown.
        texture: one of :data:`TEXTURES`.
        texture_scale_m: size of the texture's cells [m].
        seed: of the texture.
    """

    name: str
    polygon_world: NDArray[np.float64]
    colour: tuple[float, float, float]
    texture: str
    texture_scale_m: float
    seed: int


def build_region(name: str, polygon_world: Any, finish: Finish) -> Region:
    """A region with this finish; its seed is a hash of its name."""
    polygon = frozen(polygon_world, (None, 3))
    seed = zlib.crc32(name.encode()) & 0xFFFF
    return Region(name, polygon, finish.colour, finish.texture, finish.texture_scale_m, seed)


def expected_brightness(finish: Finish, normal_world: Any) -> float:
    """Brightness, 0..1, of a surface with this finish and unit normal (3,): ambient plus Lambertian light.

    NaN where its colour is unknown.
    """
    return float(finish.luma * (AMBIENT + 0.25 * np.dot(LAMP_DIRECTION, normal_world)))


FaceKind = Literal["barrier", "doorway"]


@dataclass(frozen=True, eq=False)
class Face:
    """A planar patch.

    Attributes:
        name: unique in the world.
        locale: the locale that it belongs to.
        polygon_world: (k, 3) counter-clockwise as seen from its front [m].
        kind: ``barrier``, or ``doorway`` for an opening (which has no regions).
        neighbour: the locale on its other side where it is (part of) a doorway.
        parent: name of the face that it is cut out of or stands on.
        front, back: regions on either side; those of the back are counter-clockwise as seen from the back.
        properties: anything else, by name.
    """

    name: str
    locale: str
    polygon_world: NDArray[np.float64]
    kind: FaceKind = "barrier"
    neighbour: str | None = None
    parent: str | None = None
    front: tuple[Region, ...] = ()
    back: tuple[Region, ...] = ()
    properties: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "polygon_world", frozen(self.polygon_world, (None, 3)))


def area_vector(polygon_world: NDArray[np.float64]) -> NDArray[np.float64]:
    """(..., 3) normal of a flat polygon (..., k, 3) times its area (Newell's method) [m^2]."""
    x, y, z = np.moveaxis(polygon_world - polygon_world[..., :1, :], -1, 0)
    u, v, w = (np.concatenate([c[..., 1:], c[..., :1]], axis=-1) for c in (x, y, z))
    return np.asarray(0.5 * np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1).sum(axis=-2))


def area_vectors(polygons_world: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """(m, 3) :func:`area_vector` of each polygon (k, 3): of all with as many corners at once."""
    corners, found = np.array([len(polygon) for polygon in polygons_world]), np.empty((len(polygons_world), 3))
    for count in sorted(set(corners.tolist())):
        of = np.flatnonzero(corners == count)
        found[of] = area_vector(np.array([polygons_world[i] for i in of.tolist()]))
    return found


def build_barrier(name: str, locale: str, polygon_world: Any, finish: Finish, **more: Any) -> Face:
    """A barrier whose front is one region with this finish."""
    return Face(name, locale, polygon_world, front=(build_region(name, polygon_world, finish),), **more)
