"""Faces (§3.4, Figure 6): planar patches that bound locales, of type barrier or doorway."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from world_models.building.geometry.regions import Finish, Region, build_region
from world_models.frames import frozen

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

    @property
    def area_m2(self) -> float:
        return float(np.linalg.norm(area_vector(self.polygon_world)))


def area_vector(polygon_world: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3,) normal of a flat polygon (k, 3) times its area (Newell's method) [m^2]."""
    x, y, z = (polygon_world - polygon_world[0]).T
    u, v, w = (np.concatenate([c[1:], c[:1]]) for c in (x, y, z))
    return np.asarray(0.5 * np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=1).sum(axis=0))


def build_barrier(name: str, locale: str, polygon_world: Any, finish: Finish, **more: Any) -> Face:
    """A barrier whose front is one region with this finish."""
    return Face(name, locale, polygon_world, front=(build_region(name, polygon_world, finish),), **more)
