"""The places for which light is computed: a small grid on each patch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.render.mesh import Mesh

Floats = NDArray[np.float64]
OFF_SURFACE_M = 1e-3
"""Places are so far before their surfaces [m]."""
MIN_MARGIN = 0.01
"""Places are at least so far inside their patch's sides, as a share of the middle's distance."""
MAX_CELLS = 96
"""Along each side of a patch."""


@dataclass(frozen=True, eq=False)
class LightMap:
    """T places on P patches, those of a patch row by row from ``first``.

    Attributes:
        grid: (P, 6) of each patch: coordinates s, t of its corner along the mesh's texture axes [m], cells a metre
            along s and t, columns and rows.
        first: (P,) its first place.
        points_world, normals_world: (T, 3).
        areas_m2: (T,) the patch's area divided among its places.
        patch: (T,) the patch of each place.
    """

    grid: Floats
    first: NDArray[np.int64]
    points_world: Floats
    normals_world: Floats
    areas_m2: Floats
    patch: NDArray[np.int64]


def lay_light_map(mesh: Mesh, cell_m: float) -> LightMap:
    """Places about ``cell_m`` apart on every patch, at least one."""
    grid, counts, points, areas = np.empty((len(mesh), 6)), np.empty(len(mesh), np.int64), [], []
    for p in range(len(mesh)):
        polygon = mesh.vertices_world[mesh.first[p] : mesh.first[p + 1]]
        flat = polygon @ mesh.axes_world[p].T
        low, size = flat.min(axis=0), np.maximum(np.ptp(flat, axis=0), 1e-6)
        cells = np.clip(np.ceil(size / cell_m - 1e-6), 1, MAX_CELLS).astype(int)
        grid[p] = (*low, *(cells / size), *cells)
        counts[p] = cells[0] * cells[1]
        s, t = np.meshgrid(low[0] + size[0] * (np.arange(cells[0]) + 0.5) / cells[0],
                           low[1] + size[1] * (np.arange(cells[1]) + 0.5) / cells[1])
        inside = _pull_inside(np.stack([s.ravel(), t.ravel()], axis=1), flat)
        normal = mesh.planes_world[p, :3]
        points.append(inside @ mesh.axes_world[p] + (mesh.planes_world[p, 3] + OFF_SURFACE_M) * normal)
        areas.append(np.full(counts[p], _area(flat) / counts[p]))
    patch = np.repeat(np.arange(len(mesh)), counts)
    return LightMap(grid, np.concatenate([[0], np.cumsum(counts)[:-1]]), np.concatenate(points),
                    mesh.planes_world[patch, :3], np.concatenate(areas), patch)


def _area(flat: Floats) -> float:
    x, y = flat.T
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def _pull_inside(places: Floats, flat: Floats) -> Floats:
    """Move places (n, 2) outside a convex polygon (k, 2), counter-clockwise, into it towards its middle."""
    middle, sides = flat.mean(axis=0), np.roll(flat, -1, axis=0) - flat
    inward = np.stack([-sides[:, 1], sides[:, 0]], axis=1)
    reach = np.maximum(np.sum(inward * (middle - flat), axis=1), 1e-12)
    margins = (places @ inward.T - np.sum(inward * flat, axis=1)) / reach
    lowest = margins.min(axis=1)
    pull = np.where(lowest < MIN_MARGIN, (MIN_MARGIN - lowest) / np.maximum(1.0 - lowest, 1e-12), 0.0)
    return np.asarray(places + np.clip(pull, 0.0, 1.0)[:, None] * (middle - places))
