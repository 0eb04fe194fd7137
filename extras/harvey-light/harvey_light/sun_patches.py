"""Where the sun shines through panes: polygons with sharp borders on floors, walls and furniture.

All is done in the plane across the sun's direction: what a pane lets through, cut by the patch that it falls on, less
the shadows of what is between.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray

from sim.render.mesh import Mesh

Floats = NDArray[np.float64]
MIN_AREA_M2 = 1e-3
"""Smaller parts of the light are left out, across the sun's direction [m^2]."""
MIN_SHADOW_M2 = 1e-6
"""Smaller shadows are left out, across the sun's direction [m^2]."""
MIN_COSINE = 0.02
"""Surfaces that the sun grazes more than this are left out."""
OVER_M = 0.01
"""What is so near before a patch does not shade it [m]."""


@dataclass(frozen=True, eq=False)
class SunPatch:
    """A convex polygon (k, 3) in full sun, counter-clockwise, on the mesh's patch of this number."""

    patch: int
    polygon_world: Floats


def find_sun_patches(mesh: Mesh, panes: NDArray[np.bool_], towards_sun: Floats) -> tuple[SunPatch, ...]:
    """The parts of all patches that see the sun through a pane; ``towards_sun`` is a unit vector (3,)."""
    found = []
    cosines = mesh.planes_world[:, :3] @ towards_sun
    across = _axes_across(towards_sun)
    corners = [mesh.vertices_world[mesh.first[p] : mesh.first[p + 1]] for p in range(len(mesh))]
    shadows = [shapely.Polygon(c @ across.T) for c in corners]
    tree = shapely.STRtree(shadows)
    for pane in np.flatnonzero(panes & (cosines < -MIN_COSINE)):
        near = [int(p) for p in tree.query(shadows[pane], "intersects") if p != pane and abs(cosines[p]) > MIN_COSINE]
        for p in near:
            light = shadows[pane].intersection(shadows[p])
            if cosines[p] <= 0.0 or light.area < MIN_AREA_M2 or not _is_nearer(mesh, int(pane), p, light, across,
                                                                              towards_sun):
                continue
            for q in near:
                if light.area < MIN_AREA_M2:
                    break
                common = light.intersection(shadows[q]) if q != p else None
                if common is None or common.area <= MIN_SHADOW_M2:
                    continue
                order = (int(pane), q, p)
                if all(_is_nearer(mesh, a, b, common, across, towards_sun) for a, b in pairwise(order)):
                    light = light.difference(shadows[q])
            found += [SunPatch(p, _lift(mesh, p, part, across, towards_sun)) for part in _convex_parts(light)]
    return tuple(found)


def _axes_across(towards: Floats) -> Floats:
    """(2, 3) right-handed unit axes with ``towards``."""
    aside = np.cross((0.0, 0.0, 1.0) if abs(towards[2]) < 0.9 else (1.0, 0.0, 0.0), towards)
    aside /= np.linalg.norm(aside)
    return np.stack([aside, np.cross(towards, aside)])


def _height(mesh: Mesh, patch: int, points: Floats, across: Floats, towards: Floats) -> Floats:
    """(n,) how far towards the sun the patch's plane is at points (n, 2) of the plane across."""
    normal, offset = mesh.planes_world[patch, :3], mesh.planes_world[patch, 3]
    return np.asarray((offset - points @ (across @ normal)) / (normal @ towards))


def _is_nearer(mesh: Mesh, a: int, b: int, where: shapely.Geometry, across: Floats, towards: Floats) -> bool:
    """Whether patch a is nearer to the sun than b in the middle of an area."""
    middle = np.array(where.representative_point().coords)
    heights = [_height(mesh, patch, middle, across, towards)[0] for patch in (a, b)]
    return bool(heights[0] > heights[1] + OVER_M)


def _convex_parts(area: shapely.Geometry) -> list[Floats]:
    """Convex polygons (k, 2), counter-clockwise, that make up an area; triangles where it is not convex itself."""
    parts = []
    for polygon in shapely.get_parts(area):
        if polygon.geom_type != "Polygon" or polygon.area < MIN_AREA_M2:
            continue
        polygon = shapely.remove_repeated_points(polygon.simplify(1e-4), 1e-4)
        if polygon.convex_hull.area - polygon.area < 1e-6 and not polygon.interiors:
            pieces = [polygon.convex_hull]
        else:
            pieces = list(shapely.get_parts(shapely.constrained_delaunay_triangles(polygon)))
        parts += [np.array(shapely.orient_polygons(piece).exterior.coords)[:-1] for piece in pieces
                  if piece.geom_type == "Polygon" and piece.area > 1e-5]
    return parts


def _lift(mesh: Mesh, patch: int, flat: Floats, across: Floats, towards: Floats) -> Floats:
    return np.asarray(flat @ across + _height(mesh, patch, flat, across, towards)[:, None] * towards)
