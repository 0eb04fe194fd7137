"""Line-support regions: neighbouring edge pixels whose gradients point the same way are one straight edge.

Burns grouped pixels by the direction of their gradient and fitted a line to each group. Here only local maxima of the
gradient take part (Canny's non-maximum suppression), so two edges of the same sign that lie 3 px apart stay two, and
each pixel locates the edge to a part of a pixel. Regions grow from the strongest pixels first; one that bends is split.

Source: J. B. Burns, A. R. Hanson, E. M. Riseman, Extracting Straight Lines, PAMI 8(4), 1986 ([6] of the paper);
the growing is that of R. Grompone von Gioi et al., LSD, IPOL 2012.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from knowledge_sources.methods.arrays import Floats, Floats32
from knowledge_sources.settings.features import FeaturesSettings

compiled = njit(cache=True, error_model="numpy")

_STEPS_PER_LEVEL = 32.0
"""Resolution at which gradients are sorted, so that they fit into two bytes (radix sort)."""


def find_line_regions(
    smooth: Floats32, min_gradient: float, min_length_px: float, settings: FeaturesSettings
) -> Floats:
    """Find rough segments (n, 2, 2) [px] of a smoothed image (h, w), the brighter side on the right.

    Args:
        min_gradient: least gradient of an edge pixel [grey levels/px].
        min_length_px: least length of a segment [px].
    """
    places, units, strengths, index = _find_edge_pixels(smooth, float(min_gradient))
    levels = np.rint(np.minimum(_STEPS_PER_LEVEL * strengths, 32767.0)).astype(np.int16)
    order = np.argsort(-levels, kind="stable")
    min_cosine = math.cos(settings.max_region_turn_rad)
    members, first = _grow_regions(places, units, index, order, min_cosine, settings.region_gap_px)
    segments: Floats = _fit_regions(
        places, units, members, first, float(min_length_px),
        settings.min_edge_density, settings.max_region_bend_px, settings.region_end_px,
    )
    return segments


@compiled
def _find_edge_pixels(smooth: Any, least: float) -> tuple[Any, Any, Any, Any]:
    """Find the local maxima of the gradient along its direction (non-maximum suppression).

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
            behind, ahead = _interpolate(size, x, y, -u * step, -v * step), _interpolate(size, x, y, u * step, v * step)
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
def _interpolate(size: Any, x: int, y: int, step_u: float, step_v: float) -> Any:
    """Value one step from a pixel, linearly between two neighbours; one component of the step is 1 or -1."""
    if abs(step_u) >= abs(step_v):
        side, share = x + (1 if step_u > 0.0 else -1), abs(step_v)
        return (1.0 - share) * size[y, side] + share * size[y + (1 if step_v > 0.0 else -1), side]
    side, share = y + (1 if step_v > 0.0 else -1), abs(step_u)
    return (1.0 - share) * size[side, x] + share * size[side, x + (1 if step_u > 0.0 else -1)]


@compiled
def _grow_regions(places: Any, units: Any, index: Any, order: Any, min_cosine: float, gap: int) -> tuple[Any, Any]:
    """Grow regions of like gradient direction: the edge pixels (n,) region by region, the first of each (regions + 1,).
    """
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
                    if units[k, 0] * u + units[k, 1] * v >= min_cosine * math.sqrt(u * u + v * v):
                        taken[k], members[end] = True, k
                        end += 1
                        u, v = u + units[k, 0], v + units[k, 1]
        regions += 1
    first[regions] = end
    return members, first[: regions + 1]


@compiled
def _fit_regions(
    places: Any, units: Any, members: Any, first: Any, min_length: float, min_density: float, max_bend: float,
    reach: float,
) -> Any:
    """Fit lines to the regions, split where they bend (Ramer-Douglas-Peucker); their ends (n, 2, 2)."""
    out = np.empty((len(members), 2, 2))
    waiting = np.empty((len(members) + 1, 2), np.int64)
    n = 0
    for region in range(len(first) - 1):
        if first[region + 1] - first[region] < min_density * min_length:
            continue
        _sort_along(places, units, members[first[region] : first[region + 1]])
        waiting[0, 0], waiting[0, 1] = first[region], first[region + 1]
        left = 1
        while left:
            left -= 1
            low, high = waiting[left]
            if high - low < min_density * min_length:
                continue
            piece = members[low:high]
            line = _fit_line(places, units, piece)
            if line[4] > max_bend * max_bend:
                bend = low + _find_bend(places, piece)
                waiting[left, 0], waiting[left, 1] = low, bend
                waiting[left + 1, 0], waiting[left + 1, 1] = bend, high
                left += 2
            else:
                n += _write_ends(places, piece, line, min_length, min_density, reach, out[n])
    return out[:n].copy()


@compiled
def _sort_along(places: Any, units: Any, region: Any) -> None:
    """Sort the pixels of a region along its line."""
    u, v, along_u, along_v, _ = _fit_line(places, units, region)
    t = np.empty(len(region))
    for k in range(len(region)):
        t[k] = (places[region[k], 0] - u) * along_u + (places[region[k], 1] - v) * along_v
    region[:] = region[np.argsort(t, kind="mergesort")]


@compiled
def _write_ends(
    places: Any, piece: Any, line: Any, min_length: float, min_density: float, reach: float, out: Any
) -> int:
    """Write the ends (2, 2) of a straight piece; 1 if it is long and dense enough, else 0."""
    u, v, along_u, along_v, _ = line
    low, high = math.inf, -math.inf
    for k in piece:
        t = (places[k, 0] - u) * along_u + (places[k, 1] - v) * along_v
        low, high = min(low, t - reach), max(high, t + reach)
    out[0, 0], out[0, 1] = u + low * along_u, v + low * along_v
    out[1, 0], out[1, 1] = u + high * along_u, v + high * along_v
    pixels = (high - low) * max(abs(along_u), abs(along_v))
    return int(high - low >= min_length and len(piece) >= min_density * pixels)


@compiled
def _fit_line(places: Any, units: Any, piece: Any) -> tuple[float, float, float, float, float]:
    """Total least squares: middle and direction of a line, brighter side on the right, and the variance about it."""
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
    variance = 0.5 * (uu + vv) - math.hypot(0.5 * (uu - vv), uv)
    return mean_u, mean_v, along_u, along_v, variance


@compiled
def _find_bend(places: Any, piece: Any) -> int:
    """Index of the pixel furthest from the chord of pixels in order, not one of the outermost."""
    start, end = places[piece[0]], places[piece[-1]]
    u, v = end[0] - start[0], end[1] - start[1]
    furthest, at = -1.0, len(piece) // 2
    for k in range(1, len(piece) - 1):
        off = abs((places[piece[k], 0] - start[0]) * v - (places[piece[k], 1] - start[1]) * u)
        if off > furthest:
            furthest, at = off, k
    return at
