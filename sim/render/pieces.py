"""Deferred shading: what is seen, sorted by patch, so that each patch is coloured in one pass.

A piece is a run of pixels of one row that see one patch at all their samples, or the part of one pixel that sees one
patch where the rest sees others. Compiled functions of this file call only one another, because numba's cache does not
follow calls into other files.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from world_models.compiled import compiled

Ints = NDArray[np.int32]
Floats = NDArray[np.float32]


class Pieces(NamedTuple):
    """n pieces; patch p's are ``order[first[p]:first[p + 1]]``.

    Attributes:
        row, column, length: (n,) the first pixel and the number of pixels.
        patch: (n,) the patch's number.
        weight: (n,) the part of each of its pixels that it covers.
        u, v: (n,) the mean position of its samples in the first pixel [px].
        order, first: (n,) and (P + 1,).
        bare: (height, width) the part of each pixel that sees the background.
    """

    row: Ints
    column: Ints
    length: Ints
    patch: Ints
    weight: Floats
    u: Floats
    v: Floats
    order: Ints
    first: NDArray[np.int64]
    bare: Floats


def split_pieces(seen: NDArray[np.int16], offsets: NDArray[np.float64], patches: int) -> Pieces:
    """Split the patches seen, (height, N, width), into pieces; ``offsets`` (N,) are those of the samples [px]."""
    ints, floats, bare = _split_rows(seen, offsets)
    order, first = _sort_by_patch(ints[3], patches)
    return Pieces(ints[0], ints[1], ints[2], ints[3], floats[0], floats[1], floats[2], order, first, bare)


@compiled
def _find_mixed(seen: Any) -> Any:
    """(height, width), not 0 for pixels that see more than one patch, or the background, at their samples."""
    height, samples, width = seen.shape
    mixed = np.empty((height, width), np.int16)
    for y in range(height):
        row = mixed[y]
        for x in range(width):
            row[x] = seen[y, 0, x] & np.int16(-32768)
        for r in range(1, samples):
            for x in range(width):
                row[x] |= seen[y, r, x] ^ seen[y, 0, x]
    return mixed


@compiled
def _most_pieces(seen: Any) -> int:
    """An upper bound of the number of pieces, for the memory; a tight one, as allocation takes time.

    A pixel with c changes among its samples has at most c + 1 <= 2 c pieces. A run of pixels is the first of its row,
    or differs from its neighbour in the first or last sample, or that has c > 1 and so at most 2 c - 1 pieces.
    """
    height, samples, width = seen.shape
    count: int = height
    for y in range(height):
        changes = 0
        for x in range(1, width):
            changes += (seen[y, 0, x] != seen[y, 0, x - 1]) + (seen[y, samples - 1, x] != seen[y, samples - 1, x - 1])
        for r in range(1, samples):
            for x in range(width):
                changes += 2 * (seen[y, r, x] != seen[y, r - 1, x])
        count += changes
    return count


@compiled
def _split_rows(seen: Any, offsets: Any) -> Any:
    """The fields of :class:`Pieces`: row, column, length, patch (4, n); weight, u, v (3, n); bare (height, width)."""
    height, _, width = seen.shape
    mixed, bare = _find_mixed(seen), np.zeros((height, width), np.float32)
    most = _most_pieces(seen)
    ints, floats = np.empty((4, most), np.int32), np.empty((3, most), np.float32)
    at = 0
    for y in range(height):
        x = 0
        while x < width:
            start, patch = x, seen[y, 0, x]
            while x < width and mixed[y, x] == 0 and seen[y, 0, x] == patch:
                x += 1
            if x > start:
                ints[0, at], ints[1, at], ints[2, at], ints[3, at] = y, start, x - start, patch
                floats[0, at], floats[1, at], floats[2, at] = 1.0, start, y
                at += 1
            else:
                at = _split_pixel(seen[y, :, x], x, y, offsets, ints, floats, bare, at)
                x += 1
    return ints[:, :at], floats[:, :at], bare


@compiled
def _split_pixel(seen: Any, x: int, y: int, offsets: Any, ints: Any, floats: Any, bare: Any, at: int) -> int:
    """Append the pieces of a pixel with samples ``seen`` (N,); returns the new end."""
    samples = len(offsets)
    done = 0
    for r in range(samples):
        if done >> r & 1:
            continue
        count, u, v = 0, 0.0, 0.0
        for q in range(r, samples):
            if seen[q] == seen[r]:
                done |= 1 << q
                count += 1
                u += offsets[q]
                v += q
        if seen[r] < 0:
            bare[y, x] = count / samples
            continue
        ints[0, at], ints[1, at], ints[2, at], ints[3, at] = y, x, 1, seen[r]
        floats[0, at] = count / samples
        floats[1, at], floats[2, at] = x + u / count, y + (v / count + 0.5) / samples - 0.5
        at += 1
    return at


@compiled
def _sort_by_patch(patch: Any, patches: int) -> Any:
    """``order`` and ``first`` of :class:`Pieces`."""
    order, first = np.empty(len(patch), np.int32), np.zeros(patches + 2, np.int64)
    for i in range(len(patch)):
        first[patch[i] + 2] += 1
    for p in range(2, len(first)):
        first[p] += first[p - 1]
    for i in range(len(patch)):
        order[first[patch[i] + 1]] = i
        first[patch[i] + 1] += 1
    return order, first[:-1]
