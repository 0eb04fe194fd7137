"""Which patch a ray meets first, by a tree of boxes over the patches; patches stop light from both sides.

Compiled functions of this file call only one another, because numba's cache does not follow calls into other files.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.render.mesh import Mesh
from world_models.compiled import compiled

Floats = NDArray[np.float64]
LEAF = 4
"""Patches in a leaf of the tree, at most."""
START_M = 1e-4
"""Hits nearer than this to the ray's origin do not count [m]."""
NEAR_M2 = 0.02
"""r0^2 of :func:`direct_light` [m^2]."""
NOTHING = -1


class RayTree(NamedTuple):
    """A mesh for rays.

    Attributes:
        boxes: (N, 6) lower and upper corner of each node [m].
        links: (N, 2) the two children; or for a leaf -1 - first and count of its patches in ``order``.
        order: (P,) numbers of patches.
        planes: (P, 4) n and d of n . p = d.
        first: (P + 1,) vertices of each patch.
        sides: (V, 4) inward normal and offset of each side: inside where n . p >= d.
    """

    boxes: Floats
    links: NDArray[np.int64]
    order: NDArray[np.int64]
    planes: Floats
    first: NDArray[np.int64]
    sides: Floats


def build_ray_tree(mesh: Mesh) -> RayTree:
    """The tree of a mesh of at least one patch."""
    lows = np.minimum.reduceat(mesh.vertices_world, mesh.first[:-1], axis=0) - 1e-6
    highs = np.maximum.reduceat(mesh.vertices_world, mesh.first[:-1], axis=0) + 1e-6
    middles, order = 0.5 * (lows + highs), np.arange(len(mesh))
    boxes: list[Floats] = []
    links: list[tuple[int, int]] = []

    def grow(start: int, end: int) -> int:
        here, part = len(boxes), order[start:end]
        boxes.append(np.concatenate([lows[part].min(axis=0), highs[part].max(axis=0)]))
        links.append((-1 - start, end - start))
        if end - start > LEAF:
            axis = int(np.argmax(np.ptp(middles[part], axis=0)))
            order[start:end] = part[np.argsort(middles[part, axis], kind="stable")]
            half = (start + end) // 2
            links[here] = (grow(start, half), grow(half, end))
        return here

    grow(0, len(mesh))
    return RayTree(np.array(boxes), np.array(links), order, mesh.planes_world, mesh.first, _sides(mesh))


def _sides(mesh: Mesh) -> Floats:
    """``RayTree.sides``."""
    out = np.empty((len(mesh.vertices_world), 4))
    for p in range(len(mesh)):
        polygon = mesh.vertices_world[mesh.first[p] : mesh.first[p + 1]]
        inward = np.cross(mesh.planes_world[p, :3], np.roll(polygon, -1, axis=0) - polygon)
        out[mesh.first[p] : mesh.first[p + 1]] = np.hstack([inward, np.sum(inward * polygon, axis=1, keepdims=True)])
    return out


@compiled
def first_hits(tree: Any, origins: Any, directions: Any, limits: Any) -> Any:
    """The patches (n,) that rays from ``origins`` (n, 3) meet first within ``limits`` (n,), and at which lengths."""
    patches, lengths = np.empty(len(origins), np.int64), np.empty(len(origins))
    stack = np.empty(128, np.int64)
    for i in range(len(origins)):
        o, d = origins[i], directions[i]
        patches[i], lengths[i] = _meet(tree, o[0], o[1], o[2], d[0], d[1], d[2], limits[i], False, stack)
    return patches, lengths


@compiled
def _meet(tree: Any, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, limit: float, is_any: bool,
          stack: Any) -> Any:
    """The first patch that a ray meets within ``limit`` lengths of its direction, or any where that is enough."""
    best, patch = limit, NOTHING
    ix, iy, iz = 1.0 / dx, 1.0 / dy, 1.0 / dz
    stack[0], top = 0, 1
    while top > 0:
        top -= 1
        node = stack[top]
        box = tree.boxes[node]
        ax, bx = (box[0] - ox) * ix, (box[3] - ox) * ix
        ay, by = (box[1] - oy) * iy, (box[4] - oy) * iy
        az, bz = (box[2] - oz) * iz, (box[5] - oz) * iz
        enter = max(max(min(ax, bx), min(ay, by)), max(min(az, bz), 0.0))
        leave = min(min(max(ax, bx), max(ay, by)), min(max(az, bz), best))
        if not enter <= leave:
            continue
        a, b = tree.links[node]
        if a >= 0:
            stack[top], stack[top + 1] = a, b
            top += 2
            continue
        for k in range(-1 - a, -1 - a + b):
            p = tree.order[k]
            n = tree.planes[p]
            along = n[0] * dx + n[1] * dy + n[2] * dz
            t = (n[3] - n[0] * ox - n[1] * oy - n[2] * oz) / along
            if not START_M < t < best:
                continue
            x, y, z, inside = ox + t * dx, oy + t * dy, oz + t * dz, True
            for v in range(tree.first[p], tree.first[p + 1]):
                s = tree.sides[v]
                if s[0] * x + s[1] * y + s[2] * z < s[3]:
                    inside = False
                    break
            if inside:
                best, patch = t, p
                if is_any:
                    return patch, best
    return patch, best


@compiled
def direct_light(tree: Any, points: Any, normals: Any, sources: Any, reach_m: float) -> Any:
    """Irradiance (n, 3) of points (n, 3) with normals (n, 3) by small flat sources that light before themselves.

    ``sources`` (m, 9): place, normal, and flux: radiosity times area, of three colours. Those farther than ``reach_m``
    are left out. E = flux cos cos' / (pi (r^2 + r0^2)), with r0 about half a source, so that no place is too bright.
    """
    out = np.zeros((len(points), 3))
    stack = np.empty(128, np.int64)
    for i in range(len(points)):
        p, n = points[i], normals[i]
        for j in range(len(sources)):
            s = sources[j]
            dx, dy, dz = s[0] - p[0], s[1] - p[1], s[2] - p[2]
            r2 = dx * dx + dy * dy + dz * dz
            cosine = n[0] * dx + n[1] * dy + n[2] * dz
            away = -(s[3] * dx + s[4] * dy + s[5] * dz)
            if cosine <= 0.0 or away <= 0.0 or r2 > reach_m * reach_m:
                continue
            if _meet(tree, p[0], p[1], p[2], dx, dy, dz, 0.999, True, stack)[0] != NOTHING:
                continue
            factor = cosine * away / (np.pi * r2 * (r2 + NEAR_M2))
            for c in range(3):
                out[i, c] += s[6 + c] * factor
    return out


@compiled
def gather_hits(tree: Any, points: Any, normals: Any, grid: Any, first: Any, axes: Any, rays: int) -> Any:
    """The places (n, rays), by number, that cosine-distributed rays from points meet first; -1: none, or a back.

    ``grid`` (P, 6), ``first`` (P,) and ``axes`` (P, 2, 3) are those of :class:`~harvey_light.light_map.LightMap`.
    """
    hits = np.empty((len(points), rays), np.int32)
    stack = np.empty(128, np.int64)
    for i in range(len(points)):
        p, n = points[i], normals[i]
        if abs(n[2]) < 0.9:
            ux, uy, uz = -n[1], n[0], 0.0
        else:
            ux, uy, uz = 0.0, -n[2], n[1]
        length = np.sqrt(ux * ux + uy * uy + uz * uz)
        ux, uy, uz = ux / length, uy / length, uz / length
        vx, vy, vz = n[1] * uz - n[2] * uy, n[2] * ux - n[0] * uz, n[0] * uy - n[1] * ux
        turn = (i * 0.6180339887498949) % 1.0
        for k in range(rays):
            r2 = (k + 0.5) / rays
            phi = 2.0 * np.pi * (k * 0.6180339887498949 + turn)
            r = np.sqrt(r2)
            a, b, c = r * np.cos(phi), r * np.sin(phi), np.sqrt(1.0 - r2)
            dx, dy, dz = a * ux + b * vx + c * n[0], a * uy + b * vy + c * n[1], a * uz + b * vz + c * n[2]
            q, t = _meet(tree, p[0], p[1], p[2], dx, dy, dz, 1e9, False, stack)
            hits[i, k] = NOTHING
            if q == NOTHING or tree.planes[q, 0] * dx + tree.planes[q, 1] * dy + tree.planes[q, 2] * dz >= 0.0:
                continue
            x, y, z = p[0] + t * dx, p[1] + t * dy, p[2] + t * dz
            s = axes[q, 0, 0] * x + axes[q, 0, 1] * y + axes[q, 0, 2] * z
            v = axes[q, 1, 0] * x + axes[q, 1, 1] * y + axes[q, 1, 2] * z
            column = min(max(int((s - grid[q, 0]) * grid[q, 2]), 0), int(grid[q, 4]) - 1)
            row = min(max(int((v - grid[q, 1]) * grid[q, 3]), 0), int(grid[q, 5]) - 1)
            hits[i, k] = first[q] + row * int(grid[q, 4]) + column
    return hits
