"""A small furnished room without a world file, for tests of the renderer and the body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Patch:
    """A region of a face: a flat convex polygon (k, 3) [m], colour and texture."""

    name: str
    polygon_world: Any
    colour: tuple[float, float, float] = (0.7, 0.7, 0.7)
    texture: str = "plain"
    texture_scale_m: float = 0.1
    seed: int = 0


@dataclass(frozen=True, eq=False)
class PatchFace:
    """A face with regions on its two sides."""

    front: tuple[Patch, ...]
    back: tuple[Patch, ...] = ()


def box_faces(low: Any, high: Any, name: str, *, inside: bool = False, **appearance: Any) -> tuple[PatchFace, ...]:
    """The six faces of an axis-aligned box from corner ``low`` (3,) to ``high`` (3,) [m], seen from out- or inside."""
    return tuple(
        PatchFace((Patch(f"{name}-{side}", polygon, seed=index, **appearance),))
        for index, (side, polygon) in enumerate(_sides(np.asarray(low, float), np.asarray(high, float), inside))
    )


def _sides(low: NDArray[np.float64], high: NDArray[np.float64], inside: bool) -> list[tuple[str, NDArray[np.float64]]]:
    out = []
    for axis, (minus, plus) in enumerate((("west", "east"), ("south", "north"), ("bottom", "top"))):
        b, c = (axis + 1) % 3, (axis + 2) % 3
        for side, level, outward in ((minus, low, False), (plus, high, True)):
            polygon = np.empty((4, 3))
            polygon[:, axis] = level[axis]
            polygon[:, b] = [low[b], high[b], high[b], low[b]]
            polygon[:, c] = [low[c], low[c], high[c], high[c]]
            out.append((side, polygon if outward != inside else polygon[::-1]))
    return out


def box_room(length_m: float = 6.0, width_m: float = 4.0, height_m: float = 2.6) -> tuple[PatchFace, ...]:
    """A closed room from (0, 0, 0), with a brick wall, a poster, a desk and a cabinet."""
    walls = box_faces((0, 0, 0), (length_m, width_m, height_m), "room", inside=True, texture="speckle",
                      texture_scale_m=0.06, colour=(0.78, 0.76, 0.70))
    floor = Patch("carpet", walls[4].front[0].polygon_world, (0.42, 0.40, 0.38), "carpet", 0.03, 5)
    bricks = Patch("bricks", walls[1].front[0].polygon_world, (0.62, 0.50, 0.44), "brick", 0.24, 6)
    x = length_m
    poster = Patch("poster", [(x, 2.6, 1.0), (x, 2.0, 1.0), (x, 2.0, 1.8), (x, 2.6, 1.8)], (0.6, 0.5, 0.4), "poster",
                   0.15, 7)
    return (
        *(walls[i] for i in (0, 2, 3, 5)),
        PatchFace((bricks, poster)),
        PatchFace((floor,)),
        *box_faces((3.6, 0.3, 0.0), (4.8, 1.0, 0.75), "desk", texture="wood", texture_scale_m=0.03,
                   colour=(0.52, 0.34, 0.2)),
        *box_faces((4.6, 3.3, 0.0), (5.4, 3.9, 1.9), "cabinet", colour=(0.35, 0.42, 0.45)),
    )
