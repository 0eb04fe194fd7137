"""Something that stands there and the file lacks: what a camera may expect of it."""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np

from world_models.building.geometry.faces import Face, build_barrier
from world_models.building.geometry.regions import UNKNOWN
from world_models.building.geometry.scene import LocaleGeometry

MIN_AREA_M2 = 1e-6
"""A smaller footprint hides nothing."""


def add_extra(
    parts: tuple[LocaleGeometry, ...], name: str, locale: str, footprint: Any, floor_m: float, height_m: float
) -> tuple[LocaleGeometry, ...]:
    """The geometry of a locale, with one more thing before what is behind it; the same where it hides nothing.

    The numbers of its faces follow from their names: negative, and so apart from those of the world's own faces.

    Args:
        footprint: (k, 2) corners of what it takes of the floor [m, world].
        floor_m: height of the floor [m, world].
        height_m: of its top above the floor; 0: nothing tells it, and it hides nothing.
    """
    faces = build_extra_faces(name, locale, footprint, floor_m, height_m)
    if not faces:
        return parts
    numbered = {-1 - zlib.crc32(face.name.encode()): face for face in faces}
    own = next((part for part in parts if part.neighbour is None), LocaleGeometry(locale, None, (), ()))
    changed = LocaleGeometry(own.locale, None, tuple(sorted((dict(own.faces) | numbered).items())), own.landmarks)
    return (*(part for part in parts if part is not own), changed)


def build_extra_faces(name: str, locale: str, footprint: Any, floor_m: float, height_m: float) -> tuple[Face, ...]:
    """The sides and the top of the hull of a footprint, up to a height.

    What it is nobody knows, so nothing of it is expected to be seen, and no colour is claimed; it hides what is behind.
    """
    import shapely  # slow to import, and what reads a journal needs none of it
    from shapely.geometry.polygon import orient

    hull = shapely.convex_hull(shapely.multipoints(np.asarray(footprint, float).reshape(-1, 2)))
    if not isinstance(hull, shapely.Polygon) or hull.area < MIN_AREA_M2 or height_m <= 0.0:
        return ()
    ring = np.asarray(orient(hull).exterior.coords)[:-1, :2]
    top_m = floor_m + height_m
    sides = [[(*a, floor_m), (*b, floor_m), (*b, top_m), (*a, top_m)]
             for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True)]
    top = [(float(x), float(y), top_m) for x, y in ring]
    return tuple(build_barrier(f"{name}/{index}", locale, corners, UNKNOWN)
                 for index, corners in enumerate([*sides, top]))
