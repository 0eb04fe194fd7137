"""Hidden-surface removal by a depth buffer: which patch is seen at each sample of each pixel.

Every pixel has N samples on N sub-rows, each at a different one of N horizontal offsets (an N-rooks pattern). The
position of a vertical or horizontal edge, as of a door to a level camera, is then resolved to 1/N px; a square grid
of N samples would resolve 1/sqrt(N) px.

Compiled functions of this file call only one another, because numba's cache does not follow calls into other files.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.render.mesh import Mesh, MeshView, Pinhole
from world_models.compiled import compiled, inlined

NEAR_M = 0.02
"""Depth of the near clipping plane [m]."""

ROOKS: Mapping[int, tuple[int, ...]] = {
    1: (0,),
    4: (0, 2, 1, 3),
    8: (1, 4, 7, 2, 6, 3, 0, 5),
    16: (3, 8, 15, 12, 2, 7, 5, 10, 14, 1, 6, 11, 4, 0, 13, 9),
}
"""The column of the sample on each sub-row, by number of samples. Found by a search over permutations: the RMS error
of an edge in the worst direction is 0.29, 0.15, 0.080 and 0.049 px (8 samples in bit-reversed order: 0.107)."""

MIN_VECTOR_SPAN = 24
"""Spans of fewer samples are filled one by one, longer ones by vector code."""

TILE_PX = 8
"""Side of the tiles of the coarse visibility test [px]."""

BACKGROUND = -1
"""The patch number where nothing is seen."""


def find_visible_patches(mesh: Mesh, view: MeshView, lens: Pinhole, samples: int) -> NDArray[np.int16]:
    """The number of the patch seen at every sample, (height, N, width); ``BACKGROUND`` where none is."""
    longest = int(np.diff(mesh.first).max(initial=0)) + 2
    boxes, edges, ends = _outlines(
        view.vertices_camera, mesh.first, view.facing, lens.fx, lens.fy, lens.cx, lens.cy, lens.width, lens.height,
        longest,
    )
    _cull_hidden(boxes, _cover_tiles(boxes, edges, ends, view.inverse_depths, lens.width, lens.height))
    rows, row_first = _patches_of_rows(boxes, lens.height)
    seen: NDArray[np.int16] = _fill(
        boxes, edges, ends, view.inverse_depths, rows, row_first, sample_offsets(samples), lens.width, lens.height
    )
    return seen


def sample_offsets(samples: int) -> NDArray[np.float64]:
    """(N,) horizontal offset [px] of the sample on each sub-row of a pixel.

    Raises:
        ValueError: there is no pattern of so many samples.
    """
    if samples not in ROOKS:
        raise ValueError(f"expected {', '.join(map(str, ROOKS))} samples a pixel, got {samples!r}")
    return (np.array(ROOKS[samples]) + 0.5) / samples - 0.5


@compiled
def _clip_near(vertices: Any, start: int, end: int, out: Any) -> int:
    """Cut a polygon in the camera frame at z = NEAR_M into ``out``; returns the number of vertices left."""
    count = 0
    for i in range(start, end):
        j = i + 1 if i + 1 < end else start
        za, zb = vertices[i, 2], vertices[j, 2]
        if za >= NEAR_M:
            out[count] = vertices[i]
            count += 1
        if (za >= NEAR_M) != (zb >= NEAR_M):
            t = (NEAR_M - za) / (zb - za)
            for axis in range(2):
                out[count, axis] = vertices[i, axis] + t * (vertices[j, axis] - vertices[i, axis])
            out[count, 2] = NEAR_M
            count += 1
    return count


@compiled
def _add_edges(pixels: Any, k: int, down: bool, edges: Any, at: int) -> int:
    """Append the edges of a polygon that run down (or up) as upper end x, y and dx/dy; returns the new end.

    Level edges bound nothing. Two neighbours get exactly the same line from their common edge.
    """
    for i in range(k):
        j = i + 1 if i + 1 < k else 0
        if not down:
            i, j = j, i
        if pixels[i, 1] < pixels[j, 1]:
            edges[at, 0], edges[at, 1] = pixels[i, 0], pixels[i, 1]
            edges[at, 2] = (pixels[j, 0] - pixels[i, 0]) / (pixels[j, 1] - pixels[i, 1])
            at += 1
    return at


@compiled
def _outlines(vertices: Any, first: Any, facing: Any, fx: float, fy: float, cx: float, cy: float,
              width: int, height: int, longest: int) -> Any:
    """Outlines in the image: edges (E, 3), and boxes (P, 5) of top, low, left, right [px] and greatest 1/z.

    An unseen patch has an empty box.

    Patch p's left edges are ``ends[p, 0]:ends[p, 1]``, its right ones ``ends[p, 1]:ends[p, 2]``: a patch is
    counter-clockwise to the eye, so its edges run down on its left and up on its right.
    """
    count = len(first) - 1
    boxes = np.zeros((count, 5))
    edges = np.empty((len(vertices) + 2 * count, 3))
    ends = np.zeros((count, 3), np.int64)
    cut = np.empty((longest, 3))
    pixels = np.empty((longest, 2))
    at = 0
    for p in range(count):
        if not facing[p]:
            continue
        k = _clip_near(vertices, first[p], first[p + 1], cut)
        top, low, left, right, nearest = np.inf, -np.inf, np.inf, -np.inf, 0.0
        for i in range(k):
            pixels[i, 0] = fx * cut[i, 0] / cut[i, 2] + cx
            pixels[i, 1] = fy * cut[i, 1] / cut[i, 2] + cy
            left, right = min(left, pixels[i, 0]), max(right, pixels[i, 0])
            top, low = min(top, pixels[i, 1]), max(low, pixels[i, 1])
            nearest = max(nearest, 1.0 / cut[i, 2])
        if left < width - 0.5 and right > -0.5 and top < height - 0.5 and low > -0.5:
            boxes[p] = (top, low, left, right, nearest)
            ends[p, 0] = at
            ends[p, 1] = _add_edges(pixels, k, True, edges, at)
            at = _add_edges(pixels, k, False, edges, ends[p, 1])
            ends[p, 2] = at
    return boxes, edges, ends


@inlined
def _span(edges: Any, ends: Any, y: float, width: int) -> Any:
    """The span (left, right) [px] of a convex outline in the row at ``y``."""
    left, right = -1.5, width + 0.5
    for e in range(ends[0], ends[1]):
        left = max(left, edges[e, 0] + edges[e, 2] * (y - edges[e, 1]))
    for e in range(ends[1], ends[2]):
        right = min(right, edges[e, 0] + edges[e, 2] * (y - edges[e, 1]))
    return left, right


@compiled
def _cover_tiles(boxes: Any, edges: Any, ends: Any, inverse_depths: Any, width: int, height: int) -> Any:
    """For each tile of the image, the greatest 1/z that a patch which covers the whole tile has everywhere in it."""
    covered = np.zeros(((height + TILE_PX - 1) // TILE_PX, (width + TILE_PX - 1) // TILE_PX))
    for p in range(len(boxes)):
        if boxes[p, 1] - boxes[p, 0] < TILE_PX or boxes[p, 3] - boxes[p, 2] < TILE_PX:
            continue
        low = min(height, math.floor(boxes[p, 1] + 0.5)) // TILE_PX
        for ty in range(max(0, math.ceil((boxes[p, 0] + 0.5) / TILE_PX)), low):
            y = ty * TILE_PX - 0.5
            left, right = _span(edges, ends[p], y, width)
            left_low, right_low = _span(edges, ends[p], y + TILE_PX, width)
            left, right = max(left, left_low), min(right, right_low)
            end = math.floor(min(right + 0.5, float(width)) / TILE_PX)
            for tx in range(max(0, math.ceil((left + 0.5) / TILE_PX)), end):
                w = inverse_depths[p, 0] * (tx * TILE_PX - 0.5) + inverse_depths[p, 1] * y + inverse_depths[p, 2]
                w += min(0.0, TILE_PX * inverse_depths[p, 0]) + min(0.0, TILE_PX * inverse_depths[p, 1])
                covered[ty, tx] = max(covered[ty, tx], w)
    return covered


@compiled
def _cull_hidden(boxes: Any, covered: Any) -> None:
    """Empty the boxes of patches that are hidden in every tile that they reach into."""
    high, wide = covered.shape
    for p in range(len(boxes)):
        if boxes[p, 1] <= boxes[p, 0]:
            continue
        hidden = True
        for ty in range(_tile(boxes[p, 0], high), _tile(boxes[p, 1], high) + 1):
            for tx in range(_tile(boxes[p, 2], wide), _tile(boxes[p, 3], wide) + 1):
                hidden = hidden and boxes[p, 4] * 1.000001 < covered[ty, tx]
            if not hidden:
                break
        if hidden:
            boxes[p, 1] = boxes[p, 0]


@inlined
def _tile(at: float, count: int) -> int:
    """The tile, 0..count - 1, in or next to which an image coordinate lies."""
    return int(min(max(at + 0.5, 0.0) / TILE_PX, count - 1.0))


@compiled
def _patches_of_rows(boxes: Any, height: int) -> Any:
    """The patches in row y, ``rows[row_first[y]:row_first[y + 1]]``, in the order of the mesh."""
    spans = np.zeros((len(boxes), 2), np.int64)
    row_first = np.zeros(height + 1, np.int64)
    for p in range(len(boxes)):
        top, low = boxes[p, 0], boxes[p, 1]
        if low > top and low > -0.5 and top < height - 0.5:
            spans[p, 0] = math.floor(max(top, -0.5) + 0.5)
            spans[p, 1] = math.floor(min(low, height - 0.5001) + 0.5) + 1
            for y in range(spans[p, 0], spans[p, 1]):
                row_first[y + 1] += 1
    for y in range(height):
        row_first[y + 1] += row_first[y]
    rows = np.empty(row_first[height], np.int64)
    at = row_first.copy()
    for p in range(len(boxes)):
        for y in range(spans[p, 0], spans[p, 1]):
            rows[at[y]] = p
            at[y] += 1
    return rows, row_first


@compiled
def _fill_long(inverse_depth: Any, step: Any, columns: Any, patch: Any, nearest: Any, seen: Any, front: Any) -> None:
    """Write a patch into a span of a sub-row wherever it is not farther than what is there.

    Three plain loops with a bit mask: LLVM vectorizes these, but not one loop with an "if".
    """
    for i in range(len(columns)):
        front[i] = -np.int16(inverse_depth + step * columns[i] >= nearest[i])
    for i in range(len(columns)):
        nearest[i] = np.maximum(nearest[i], inverse_depth + step * columns[i])
    for i in range(len(columns)):
        seen[i] = (seen[i] & ~front[i]) | (patch & front[i])


@inlined
def _fill_short(inverse_depth: Any, step: Any, columns: Any, patch: Any, nearest: Any, seen: Any, r: int, start: int,
                end: int) -> None:
    """The same for columns ``start`` to ``end`` of sub-row r, one by one (unsigned: no test for negative indices)."""
    for i in range(np.uint64(start), np.uint64(end)):
        w = inverse_depth + step * columns[i]
        if w >= nearest[r, i]:
            nearest[r, i] = w
            seen[r, i] = patch


@inlined
def _column(x: float, width: int) -> int:
    """The first column, 0..width, whose sample is not left of x; faster than math.ceil."""
    return width - int(width - min(max(x, 0.0), float(width)))


@inlined
def _fill_patch(p: int, heights: Any, boxes: Any, edges: Any, ends: Any, inverse_depths: Any, offsets: Any,
                columns: Any, nearest: Any, seen: Any, front: Any) -> None:
    """Write patch p into the sub-rows (N, width) of one pixel row, at ``heights`` (N,) [px]."""
    samples, width = nearest.shape
    patch, step = np.int16(p), np.float32(inverse_depths[p, 0])
    for r in range(samples):
        y = heights[r]
        if y < boxes[p, 0] or y >= boxes[p, 1]:
            continue
        left, right = _span(edges, ends[p], y, width)
        start, end = _column(left - offsets[r], width), _column(right - offsets[r], width)
        w = np.float32(inverse_depths[p, 0] * offsets[r] + inverse_depths[p, 1] * y + inverse_depths[p, 2])
        if end - start < MIN_VECTOR_SPAN:
            _fill_short(w, step, columns, patch, nearest, seen, r, start, end)
        else:
            _fill_long(w, step, columns[start:end], patch, nearest[r, start:end], seen[r, start:end], front[start:end])


@compiled
def _fill(boxes: Any, edges: Any, ends: Any, inverse_depths: Any, rows: Any, row_first: Any, offsets: Any,
          width: int, height: int) -> Any:
    """The patch at every sample, row by row, so that the depth buffer of one row stays in the cache."""
    samples = len(offsets)
    seen = np.empty((height, samples, width), np.int16)
    nearest = np.empty((samples, width), np.float32)
    columns = np.arange(width).astype(np.float32)
    front = np.empty(width, np.int16)
    sub_rows = (np.arange(samples) + 0.5) / samples
    for row in range(height):
        heights = row - 0.5 + sub_rows
        nearest[:] = 0.0
        seen[row] = BACKGROUND
        for p in rows[row_first[row] : row_first[row + 1]]:
            _fill_patch(p, heights, boxes, edges, ends, inverse_depths, offsets, columns, nearest, seen[row], front)
    return seen
