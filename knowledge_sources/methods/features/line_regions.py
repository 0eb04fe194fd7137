"""Line-support regions: neighbouring edge pixels whose gradients point the same way are one straight edge.

Burns grouped pixels by the direction of their gradient and fitted a line to each group. Here only the pixels at which
the gradient is greatest along itself take part, so two edges of the same sign that lie 3 px apart stay two, and each
brings its place to a part of a pixel. Regions grow from the strongest pixels first; one that bends is cut in two.

Source: J. B. Burns, A. R. Hanson, E. M. Riseman, Extracting Straight Lines, PAMI 8(4), 1986 ([6] of the paper);
the growing is that of R. Grompone von Gioi et al., LSD, IPOL 2012.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

compiled = njit(cache=True, error_model="numpy")

TURN_RAD = math.radians(22.5)
"""Gradients of one region lie within this angle of its mean."""
GAP_PX = 2
"""Edge pixels so far apart may belong to one region: noise makes holes in faint edges."""
STRAIGHT_PX = 0.6
"""A region whose pixels lie further than this off its line, in the mean square, is cut where it bends."""
END_PX = 1.5
"""An edge reaches so far beyond its last pixel: half a pixel, and what smoothing rounds off at a corner."""
_LEVELS = 32.0
"""Regions grow from the strongest pixels first; so many strengths a grey level per px are told apart."""
LEAST_DENSITY = 0.6
"""Share of a segment's length at which there must be an edge pixel."""


def line_regions(smooth: NDArray[np.float32], least_gradient: float, least_length_px: float) -> NDArray[np.float64]:
    """Rough segments (n, 2, 2) [px] of a smoothed image (h, w), the brighter side on the right.

    Args:
        least_gradient: pixels of a lesser gradient are no edge [grey levels per px].
        least_length_px: shorter segments are dropped [px].
    """
    places, units, strengths, index = _edge_pixels(smooth, float(least_gradient))
    levels = np.rint(np.minimum(_LEVELS * strengths, 32767.0)).astype(np.int16)
    order = np.argsort(-levels, kind="stable")  # whole numbers of two bytes are sorted by radix
    members, first = _grown(places, units, index, order, math.cos(TURN_RAD), GAP_PX)
    segments: NDArray[np.float64] = _segments(places, units, members, first, float(least_length_px))
    return segments


@compiled
def _edge_pixels(smooth: Any, least: float) -> tuple[Any, Any, Any, Any]:
    """Where the gradient is greatest along itself.

    Returns:
        Places (n, 2) between pixels, unit gradients (n, 2) and their sizes (n,); (h, w) the number of each, or -1.
    """
    height, width = smooth.shape
    size = np.zeros((height, width), np.float32)
    count = 0
    for y in range(1, height - 1):
        for x in range(1, width - 1):
            u, v = smooth[y, x + 1] - smooth[y, x - 1], smooth[y + 1, x] - smooth[y - 1, x]
            size[y, x] = np.float32(0.5) * np.sqrt(u * u + v * v)  # in single precision, many at once
        for x in range(1, width - 1):
            count += size[y, x] >= least
    places, units, sizes = np.empty((count, 2)), np.empty((count, 2)), np.empty(count)
    index = np.full((height, width), -1, np.int32)
    n = 0
    for y in range(2, height - 2):
        for x in range(2, width - 2):
            if size[y, x] < least:
                continue
            half = 0.5 / size[y, x]
            u, v = half * (smooth[y, x + 1] - smooth[y, x - 1]), half * (smooth[y + 1, x] - smooth[y - 1, x])
            step = 1.0 / max(abs(u), abs(v))
            behind, ahead = _between(size, x, y, -u * step, -v * step), _between(size, x, y, u * step, v * step)
            middle = float(size[y, x])
            if middle < behind or middle <= ahead:
                continue
            off = 0.5 * (ahead - behind) / (2.0 * middle - ahead - behind) * step
            places[n, 0], places[n, 1] = x + off * u, y + off * v
            units[n, 0], units[n, 1], sizes[n] = u, v, middle
            index[y, x] = n
            n += 1
    return places[:n], units[:n], sizes[:n], index


@compiled
def _between(size: Any, x: int, y: int, step_u: float, step_v: float) -> Any:
    """What lies a step from a pixel, linearly between two neighbours: one part of the step is 1 or -1."""
    if abs(step_u) >= abs(step_v):
        side, share = x + (1 if step_u > 0.0 else -1), abs(step_v)
        return (1.0 - share) * size[y, side] + share * size[y + (1 if step_v > 0.0 else -1), side]
    side, share = y + (1 if step_v > 0.0 else -1), abs(step_u)
    return (1.0 - share) * size[side, x] + share * size[side, x + (1 if step_u > 0.0 else -1)]


@compiled
def _grown(places: Any, units: Any, index: Any, order: Any, least_cosine: float, gap: int) -> tuple[Any, Any]:
    """The edge pixels (n,) region by region, and the first of each region (regions + 1,)."""
    members, first = np.empty(len(order), np.int64), np.empty(len(order) + 1, np.int64)
    taken = np.zeros(len(order), np.bool_)
    regions = end = 0
    for seed in order:
        if taken[seed]:
            continue
        first[regions] = at = end
        taken[seed], members[end] = True, seed
        end += 1
        u, v = units[seed, 0], units[seed, 1]
        while at < end:
            x, y = int(places[members[at], 0] + 0.5), int(places[members[at], 1] + 0.5)
            at += 1
            for row in range(max(y - gap, 0), min(y + gap + 1, index.shape[0])):
                for column in range(max(x - gap, 0), min(x + gap + 1, index.shape[1])):
                    k = index[row, column]
                    if k < 0 or taken[k]:
                        continue
                    if units[k, 0] * u + units[k, 1] * v >= least_cosine * math.sqrt(u * u + v * v):
                        taken[k], members[end] = True, k
                        end += 1
                        u, v = u + units[k, 0], v + units[k, 1]
        regions += 1
    first[regions] = end
    return members, first[: regions + 1]


@compiled
def _segments(places: Any, units: Any, members: Any, first: Any, least_length: float) -> Any:
    """Lines through the regions, cut where they bend; ends (n, 2, 2)."""
    out = np.empty((len(members), 2, 2))
    waiting = np.empty((len(members) + 1, 2), np.int64)
    n = 0
    for region in range(len(first) - 1):
        if first[region + 1] - first[region] < LEAST_DENSITY * least_length:
            continue
        _put_in_order(places, units, members[first[region] : first[region + 1]])
        waiting[0, 0], waiting[0, 1] = first[region], first[region + 1]
        left = 1
        while left:
            left -= 1
            low, high = waiting[left]
            if high - low < LEAST_DENSITY * least_length:
                continue
            piece = members[low:high]
            line = _line(places, units, piece)
            if line[4] > STRAIGHT_PX * STRAIGHT_PX:
                bend = low + _bend(places, piece)
                waiting[left, 0], waiting[left, 1] = low, bend
                waiting[left + 1, 0], waiting[left + 1, 1] = bend, high
                left += 2
            else:
                n += _ends(places, piece, line, least_length, out[n])
    return out[:n].copy()


@compiled
def _put_in_order(places: Any, units: Any, region: Any) -> None:
    """Sort the pixels of a region along its line."""
    u, v, along_u, along_v, _ = _line(places, units, region)
    t = np.empty(len(region))
    for k in range(len(region)):
        t[k] = (places[region[k], 0] - u) * along_u + (places[region[k], 1] - v) * along_v
    region[:] = region[np.argsort(t, kind="mergesort")]


@compiled
def _ends(places: Any, piece: Any, line: Any, least_length: float, out: Any) -> int:
    """Write the ends (2, 2) of a straight piece; 1 if it is long and dense enough, else 0."""
    u, v, along_u, along_v, _ = line
    low, high = math.inf, -math.inf
    for k in piece:
        t = (places[k, 0] - u) * along_u + (places[k, 1] - v) * along_v
        low, high = min(low, t - END_PX), max(high, t + END_PX)
    out[0, 0], out[0, 1] = u + low * along_u, v + low * along_v
    out[1, 0], out[1, 1] = u + high * along_u, v + high * along_v
    pixels = (high - low) * max(abs(along_u), abs(along_v))
    return int(high - low >= least_length and len(piece) >= LEAST_DENSITY * pixels)


@compiled
def _line(places: Any, units: Any, piece: Any) -> tuple[float, float, float, float, float]:
    """Middle and direction of the line through pixels, brighter side on the right, and their variance about it."""
    count = len(piece)
    mean_u = mean_v = toward_u = toward_v = 0.0
    for k in piece:
        mean_u, mean_v = mean_u + places[k, 0] / count, mean_v + places[k, 1] / count
        toward_u, toward_v = toward_u + units[k, 0], toward_v + units[k, 1]
    uu = uv = vv = 0.0
    for k in piece:
        u, v = places[k, 0] - mean_u, places[k, 1] - mean_v
        uu, uv, vv = uu + u * u / count, uv + u * v / count, vv + v * v / count
    angle = 0.5 * math.atan2(2.0 * uv, uu - vv)
    along_u, along_v = math.cos(angle), math.sin(angle)
    if along_u * toward_v - along_v * toward_u < 0.0:
        along_u, along_v = -along_u, -along_v
    least = 0.5 * (uu + vv) - math.hypot(0.5 * (uu - vv), uv)
    return mean_u, mean_v, along_u, along_v, least


@compiled
def _bend(places: Any, piece: Any) -> int:
    """Which pixel lies furthest from the chord of pixels in order, not one of the outermost."""
    start, end = places[piece[0]], places[piece[-1]]
    u, v = end[0] - start[0], end[1] - start[1]
    furthest, at = -1.0, len(piece) // 2
    for k in range(1, len(piece) - 1):
        off = abs((places[piece[k], 0] - start[0]) * v - (places[piece[k], 1] - start[1]) * u)
        if off > furthest:
            furthest, at = off, k
    return at
