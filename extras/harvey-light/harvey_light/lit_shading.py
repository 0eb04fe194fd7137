"""Colours of the pieces of a picture under light that varies from place to place, with reflections.

Compiled functions of this file call only one another, because numba's cache does not follow calls into other files.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from world_models.compiled import compiled

GAMMA = np.float32(2.2)
NORMAL_REFLECTANCE = np.float32(0.04)
"""Of glass and polish, seen from straight before them (Schlick 1994)."""
ZERO, ONE, HALF, MIN_INVERSE_DEPTH = np.float32(0.0), np.float32(1.0), np.float32(0.5), np.float32(1e-4)
NO_MIRROR = -1


@compiled
def shade_lit(pieces: Any, colours: Any, forms: Any, grid: Any, first: Any, light: Any, image: Any, glossy: Any,
              gloss: Any, reaches: Any, mirrors: Any, rays: Any) -> None:
    """Add the pieces to ``image`` (height, width, 3), which has the background.

    Args:
        pieces: :class:`sim.render.pieces.Pieces`.
        colours: (n, 3) of their pixels in full light, patch by patch (:func:`sim.render.textures.shade_pieces`).
        forms: (P, 11) of 1/z, s / z, t / z (9) and bases (2) [m] (:class:`sim.render.mesh.MeshView`).
        grid, first: (P, 6), (P,) of the light map, with corners in the coordinates of ``forms``.
        light: (T, 3) factor on the colour at each place, as seen.
        glossy: (P,) the mirror image for each patch, or -1.
        gloss: (P,) factor on what it reflects.
        reaches: (P,) distance of the camera before the patch's plane, negative [m].
        mirrors: (k, height, width, 3).
        rays: (height, width) length of the ray (x / z, y / z, 1) of each pixel.
    """
    at = 0
    for p in range(len(forms)):
        f = forms[p].astype(np.float32)
        s0, t0 = np.float32(grid[p, 0] - forms[p, 9]), np.float32(grid[p, 1] - forms[p, 10])
        cs, ct, columns, rows = np.float32(grid[p, 2]), np.float32(grid[p, 3]), int(grid[p, 4]), int(grid[p, 5])
        mirror, shine, reach = glossy[p], np.float32(gloss[p]), np.float32(reaches[p])
        last_s, last_t = np.float32(columns - 1), np.float32(rows - 1)
        for e in range(pieces.first[p], pieces.first[p + 1]):
            i = pieces.order[e]
            y, x, weight = pieces.row[i], pieces.column[i], pieces.weight[i]
            for k in range(pieces.length[i]):
                u, v = pieces.u[i] + np.float32(k), pieces.v[i]
                w = np.maximum(f[0] * u + f[1] * v + f[2], MIN_INVERSE_DEPTH)
                a = ((f[3] * u + f[4] * v + f[5]) / w - s0) * cs - HALF
                b = ((f[6] * u + f[7] * v + f[8]) / w - t0) * ct - HALF
                a, b = np.minimum(np.maximum(a, ZERO), last_s), np.minimum(np.maximum(b, ZERO), last_t)
                i0, j0 = int(a), int(b)
                i1, j1 = min(i0 + 1, columns - 1), min(j0 + 1, rows - 1)
                a, b = a - np.float32(i0), b - np.float32(j0)
                c00, c10 = first[p] + j0 * columns + i0, first[p] + j0 * columns + i1
                c01, c11 = first[p] + j1 * columns + i0, first[p] + j1 * columns + i1
                reflects = ZERO
                if mirror != NO_MIRROR:
                    grazing = ONE - np.minimum(ONE, np.abs(w * reach) / rays[y, x + k])
                    square = grazing * grazing
                    reflects = shine * (NORMAL_REFLECTANCE + (ONE - NORMAL_REFLECTANCE) * square * square * grazing)
                for c in range(3):
                    upper = light[c00, c] + a * (light[c10, c] - light[c00, c])
                    lower = light[c01, c] + a * (light[c11, c] - light[c01, c])
                    seen = colours[at, c] * (upper + b * (lower - upper))
                    if mirror != NO_MIRROR:
                        both = (ONE - reflects) * seen**GAMMA + reflects * mirrors[mirror, y, x + k, c] ** GAMMA
                        seen = both ** (ONE / GAMMA)
                    image[y, x + k, c] += weight * seen
                at += 1
