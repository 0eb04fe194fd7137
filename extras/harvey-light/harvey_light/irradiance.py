"""How much light arrives at each place: from lamps, panes and the sun, and by reflection.

Direct light: small parts of each panel and pane, with shadows by rays. Indirect light: rays from each place find what
it sees, once; each bounce is then the mean of what these places reflect (Jacobi's iteration of the radiosity equation,
B = E0 + rho F B; Goral et al. 1984). All surfaces reflect alike in all directions here.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from harvey_light.hung_lamps import Lamp
from harvey_light.light_map import LightMap
from harvey_light.rays import RayTree, build_ray_tree, direct_light, first_hits, gather_hits
from sim.render.lighting import GAMMA, Lighting
from sim.render.mesh import Mesh
from sim.render.renderer import illumination

Floats = NDArray[np.float64]
SKY_COLOUR = np.array([0.85, 0.97, 1.15])
SUN_COLOUR = np.array([1.10, 1.00, 0.82])
PART_M = 0.4
"""Panels and panes are divided into parts of about this size [m]."""
REACH_M = 12.0
"""Light of panels and panes that are farther away is left out [m]."""
COVER_M = 0.15
"""Places that something so near hides get the light of their neighbours: pictures and panels hang before them [m]."""
SOURCE_ALBEDO = 0.05
"""Share of light that panels and panes reflect."""


def compute_irradiance(
    mesh: Mesh, places: LightMap, lighting: Lighting, lamps: Sequence[Lamp], panes: NDArray[np.bool_],
    sources: NDArray[np.bool_],
) -> Floats:
    """Irradiance (T, 3) at each place, without the sun's direct light, which is drawn with sharp borders.

    Args:
        panes: (P,) which patches are window panes.
        sources: (P,) which are panes or lamps.
    """
    tree = build_ray_tree(mesh)
    parts = np.concatenate([np.zeros((0, 9)), *(_parts(lamp.polygon_world, lamp.radiosity) for lamp in lamps)])
    if lighting.sky > 0.0:
        glass = [mesh.vertices_world[mesh.first[p] : mesh.first[p + 1]] for p in np.flatnonzero(panes)]
        parts = np.concatenate([parts, *(_parts(polygon, lighting.sky * SKY_COLOUR) for polygon in glass)])
    parts = parts[parts[:, 6:].any(axis=1)]
    direct = direct_light(tree, places.points_world, places.normals_world, parts, REACH_M)
    total = direct + _reflected(mesh, places, lighting, tree, direct + _sun(places, lighting, tree, panes), sources)
    total = _fill_covered(total, places, tree)
    flat = lighting.flat * illumination(mesh.planes_world[:, :3]) ** GAMMA
    return np.asarray(total + flat[places.patch, None])


def _parts(polygon: Floats, radiosity: Floats) -> Floats:
    """A rectangle (4, 3) as small sources for :func:`~harvey_light.rays.direct_light`."""
    along, across = polygon[1] - polygon[0], polygon[3] - polygon[0]
    counts = [max(1, round(float(np.linalg.norm(side)) / PART_M)) for side in (along, across)]
    i, j = np.meshgrid((np.arange(counts[0]) + 0.5) / counts[0], (np.arange(counts[1]) + 0.5) / counts[1])
    middles = polygon[0] + i.reshape(-1, 1) * along + j.reshape(-1, 1) * across
    area = np.cross(along, across)
    size = float(np.linalg.norm(area))
    rest = np.concatenate([area / size, radiosity * size / len(middles)])
    return np.hstack([middles, np.tile(rest, (len(middles), 1))])


def _sun(places: LightMap, lighting: Lighting, tree: RayTree, panes: NDArray[np.bool_]) -> Floats:
    """(T, 3) the sun's direct light, at places that see it through a pane."""
    out = np.zeros((len(places.patch), 3))
    towards = np.array(lighting.towards_sun)
    cosines = places.normals_world @ towards
    facing = np.flatnonzero(cosines > 0.0)
    if lighting.sun > 0.0 and panes.any():
        directions = np.tile(towards, (len(facing), 1))
        met, _ = first_hits(tree, places.points_world[facing], directions, np.full(len(facing), 1e9))
        lit = facing[(met >= 0) & panes[met]]
        out[lit] = lighting.sun * SUN_COLOUR * cosines[lit, None]
    return out


def _reflected(
    mesh: Mesh, places: LightMap, lighting: Lighting, tree: RayTree, first: Floats, sources: NDArray[np.bool_]
) -> Floats:
    """(T, 3) light that arrives by reflection, where ``first`` (T, 3) arrives without."""
    if not lighting.bounces or not first.any():
        return np.zeros_like(first)
    hits = gather_hits(tree, places.points_world, places.normals_world, places.grid, places.first, mesh.axes_world,
                       lighting.rays)
    albedo = np.where(sources[:, None], SOURCE_ALBEDO, mesh.colours**GAMMA)[places.patch]
    reflected = np.zeros_like(first)
    for _ in range(lighting.bounces):
        leaving = np.vstack([albedo * (first + reflected), np.zeros(3)])  # hit -1 is the last row: nothing
        reflected = np.zeros_like(first)
        for k in range(hits.shape[1]):  # ray by ray: all at once would take gigabytes
            reflected += leaving[hits[:, k]]
        reflected /= hits.shape[1]
    return _smooth(np.asarray(reflected), places)


def _smooth(light: Floats, places: LightMap) -> Floats:
    """The mean over neighbouring places of a patch: reflected light varies slowly, and its rays are few."""
    from scipy.ndimage import uniform_filter  # loaded when light is computed: most missions have it plain or baked

    out, sizes = light.copy(), places.grid[:, 4:].astype(int)
    for p in np.flatnonzero(sizes.max(axis=1) > 1):
        columns, rows = sizes[p]
        here = slice(places.first[p], places.first[p] + columns * rows)
        out[here] = uniform_filter(light[here].reshape(rows, columns, 3), (3, 3, 1), mode="nearest").reshape(-1, 3)
    return np.maximum(out, 0.0)  # a running sum can end just below


def _fill_covered(light: Floats, places: LightMap, tree: RayTree) -> Floats:
    """The light (T, 3), where something hangs close before a place that of the nearest place of its patch where
    nothing does.
    """
    from scipy.ndimage import distance_transform_edt

    limits = np.full(len(light), COVER_M)
    covered = first_hits(tree, places.points_world, places.normals_world, limits)[0] >= 0
    out, sizes = light.copy(), places.grid[:, 4:].astype(int)
    for p in np.unique(places.patch[covered]):
        start, (columns, rows) = places.first[p], sizes[p]
        hidden = covered[start : start + columns * rows].reshape(rows, columns)
        if not hidden.all():
            near = distance_transform_edt(hidden, return_distances=False, return_indices=True)
            out[start : start + columns * rows] = light[start + (near[0] * columns + near[1]).ravel()]
    return out
