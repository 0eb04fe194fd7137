"""Rough segments: line-support regions of the whole image, or chains of edges in bands round predicted lines.

*Regions.* Burns grouped pixels by the direction of their gradient and fitted a line to each group. Here only local
maxima of the gradient take part (Canny's non-maximum suppression), so two edges of the same sign that lie 3 px apart
stay two, and each pixel locates the edge to a part of a pixel. Regions grow from the strongest pixels first; one that
bends is split. Source: J. B. Burns, A. R. Hanson, E. M. Riseman, Extracting Straight Lines, PAMI 8(4), 1986 ([6] of the
paper); the growing is that of R. Grompone von Gioi et al., LSD, IPOL 2012.

*Bands* (Figure 1). Each band is straightened into a strip whose columns run across the predicted line; the strips stand
side by side in one canvas. Smoothing then runs *along* the predicted direction, which brings out faint edges, and an
edge is a chain of gradient peaks, column after column.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import cv2
import numpy as np

from knowledge_sources.methods.arrays import Floats, Floats32, Indices, Mask
from world_models.camera import clip_segments
from world_models.compiled import compiled

MIN_GRADIENT_SIGMAS = 4.0  # least gradient of an edge pixel, in standard deviations of the gradient of pure noise
MIN_EDGE_DENSITY = 0.6  # least share of a segment's length that has an edge pixel
# rad; largest angle between a pixel's gradient and the mean of its line-support region (Burns et al. 1986; Grompone
# von Gioi et al. 2012)
MAX_REGION_TURN_RAD = math.radians(22.5)
REGION_GAP_PX = 2  # px; distance of edge pixels that may still belong to one line-support region
MAX_REGION_BEND_PX = 0.6  # px; largest RMS distance of a region's pixels from its line before it is cut in two
REGION_END_PX = 1.5  # px; distance by which an edge reaches beyond its last edge pixel (measured on rendered corners)
MAX_BAND_TURN_RAD = 0.3  # rad; largest angle between a segment and the predicted line
BAND_SMOOTHING_ALONG_PX = 2.0  # px; standard deviation of the smoothing of a band along the predicted line
BAND_SMOOTHING_ACROSS_PX = 1.0  # px; standard deviation of the smoothing of a band across the predicted line
MIN_BAND_GRADIENT_PER_PX = 0.5  # grey levels/px; least gradient of an edge in a band, however little noise there is
CHAIN_GAP_PX = 2  # px; half the gap over which gradient peaks of a band are joined to one chain
CHAIN_SCALE_PX = 0.5  # px; scale of the Geman-McClure weights of the line fit to a chain
CHAIN_ITERATIONS = 3  # reweighting steps of the line fit to a chain
MAX_CHAIN_RESIDUAL_PX = 1.0  # px; largest distance of a peak from the line of its chain

_STEPS_PER_LEVEL = 32.0
"""Resolution at which gradients are sorted, so that they fit into two bytes (radix sort)."""


def find_line_regions(
    smooth: Floats32, min_gradient: float, min_length_px: float
) -> Floats:
    """Find rough segments (n, 2, 2) [px] of a smoothed image (h, w), the brighter side on the right.

    Args:
        min_gradient: least gradient of an edge pixel [grey levels/px].
        min_length_px: least length of a segment [px].
    """
    places, units, strengths, index = _find_edge_pixels(smooth, float(min_gradient))
    levels = np.rint(np.minimum(_STEPS_PER_LEVEL * strengths, 32767.0)).astype(np.int16)
    order = np.argsort(-levels, kind="stable")
    min_cosine = math.cos(MAX_REGION_TURN_RAD)
    members, first = _grow_regions(places, units, index, order, min_cosine, REGION_GAP_PX)
    segments: Floats = _fit_regions(
        places, units, members, first, float(min_length_px),
        MIN_EDGE_DENSITY, MAX_REGION_BEND_PX, REGION_END_PX,
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


_MAP_WIDTH = 1024
"""Columns of the maps given to OpenCV, which limits both sides of its result to 32767."""


class _Strips(NamedTuple):
    """The bands side by side.

    Attributes:
        x, y: (rows, columns) place in the image of every canvas cell [px].
        owner: (columns,) index of each column's prediction.
        usable: (rows, columns) cells that may hold peaks.
    """

    x: Floats
    y: Floats
    owner: Indices
    usable: Mask


class BandSegments(NamedTuple):
    """Rough segments found in bands.

    Attributes:
        segments_px: (n, 2, 2) [px].
        sign: (n,) 1 where the right-hand side is brighter, else -1.
        predicted: (n,) index of the prediction in whose band a segment lies.
    """

    segments_px: Floats
    sign: Floats
    predicted: Indices


class _Chains(NamedTuple):
    """Gradient peaks by chain: column (n,), sub-pixel row (n,) and number of the chain (n,)."""

    column: Indices
    row: Floats
    label: Indices


def find_in_bands(
    image: Floats32, predicted_px: Floats, noise: float, band_px: float, min_length_px: float,
) -> BandSegments:
    """Find rough segments near predicted lines; their ends run the way of the prediction.

    Args:
        image: (h, w) grey levels.
        predicted_px: (m, 2, 2) [px]; NaN rows find nothing.
        noise: standard deviation of the pixel noise [grey levels].
        band_px: half-width of a band, and its reach beyond the prediction's ends [px].
        min_length_px: least length of a segment [px].
    """
    smooth, derivative = (
        _build_gaussian(BAND_SMOOTHING_ALONG_PX), _build_derivative(BAND_SMOOTHING_ACROSS_PX))
    strips = _build_strips(image.shape, predicted_px, band_px, guard=len(smooth) // 2)
    if strips is None:
        return BandSegments(np.zeros((0, 2, 2)), np.zeros(0), np.zeros(0, np.intp))
    gradient = np.asarray(cv2.sepFilter2D(_sample(image, strips.x, strips.y), cv2.CV_32F, smooth, derivative))
    noise_gain = float(np.linalg.norm(smooth) * np.linalg.norm(derivative))
    threshold = max(MIN_GRADIENT_SIGMAS * noise * noise_gain, MIN_BAND_GRADIENT_PER_PX)
    parts = []
    for sign in (1.0, -1.0):
        chains = _find_chains(sign * gradient, strips.usable, threshold, min_length_px)
        ends, owner = _fit_chains(strips, chains, min_length_px)
        parts.append((ends, np.full(len(ends), sign), owner))
    ends, signs, owners = zip(*parts, strict=True)
    return BandSegments(np.concatenate(ends), np.concatenate(signs), np.concatenate(owners))


def _build_strips(shape: tuple[int, ...], predicted: Floats, band: float, guard: int) -> _Strips | None:
    """The strips of all predictions; ``guard`` columns beyond each end of a strip only feed the smoothing."""
    # What is further outside than the band cannot show, however far a prediction runs.
    clipped, usable = clip_segments(predicted + band, round(shape[1] + 2.0 * band), round(shape[0] + 2.0 * band))
    predicted = clipped - band
    delta = predicted[:, 1] - predicted[:, 0]
    length = np.linalg.norm(delta, axis=1)
    usable &= length > 1e-6
    if not usable.any():
        return None
    which = np.flatnonzero(usable)
    along = delta[which] / length[which, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    margin = band + guard
    # A whole number of columns stays that number when the band is shifted and its length rounds up by a last bit.
    counts = np.ceil(length[which] + 2.0 * margin - 1e-6).astype(np.intp) + 1
    first = np.concatenate([[0], np.cumsum(counts)[:-1]])
    strip = np.repeat(np.arange(len(which)), counts)
    step = np.arange(len(strip)) - first[strip]
    t = step - (counts[strip] - 1 - length[which][strip]) / 2.0
    half = int(np.ceil(band)) + 2
    offset = np.arange(-half, half + 1, dtype=float)[:, None]
    base = predicted[which, 0][strip] + t[:, None] * along[strip]
    x = base[:, 0] + offset * across[strip, 0]
    y = base[:, 1] + offset * across[strip, 1]
    inside = (x > 1.0) & (x < shape[1] - 2.0) & (y > 1.0) & (y < shape[0] - 2.0)
    inside &= (step >= guard) & (step < counts[strip] - guard) & (np.abs(offset) <= band)
    return _Strips(x, y, which[strip], inside)


def _sample(image: Floats32, x: Floats, y: Floats) -> Floats32:
    """Bilinear values of an image (h, w) at places x, y [px] of any one shape; the border value continues outside."""
    count = x.size
    rows = -(-count // _MAP_WIDTH)
    maps = np.zeros((2, rows * _MAP_WIDTH), np.float32)
    maps[0, :count], maps[1, :count] = x.ravel(), y.ravel()
    map_x, map_y = maps.reshape(2, rows, _MAP_WIDTH)
    values = cv2.remap(image, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(values, np.float32).ravel()[:count].reshape(x.shape)


def _build_gaussian(sigma: float) -> Floats:
    """A normalised kernel that reaches to three standard deviations."""
    reach = int(np.ceil(3.0 * sigma))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    return np.asarray(kernel / kernel.sum())


def _build_derivative(sigma: float) -> Floats:
    """A kernel that correlates to the derivative of the smoothed signal [per px]."""
    smooth = _build_gaussian(sigma)
    place = np.arange(len(smooth)) - len(smooth) // 2
    kernel = smooth * place
    return np.asarray(kernel / (kernel * place).sum())


def _find_chains(
    gradient: Floats32, usable: Mask, threshold: float, min_length: float
) -> _Chains:
    """Join the gradient peaks of neighbouring columns to chains, without those sure to be too short."""
    peak = np.zeros(gradient.shape, bool)
    mid = gradient[1:-1]
    peak[1:-1] = (mid > threshold) & (mid >= gradient[:-2]) & (mid > gradient[2:])
    peak &= usable
    joined = cv2.dilate(peak.view(np.uint8), np.ones((1, 2 * CHAIN_GAP_PX + 1), np.uint8))
    _, labels = cv2.connectedComponents(joined, connectivity=8)
    row, column = np.nonzero(peak)
    label = labels[row, column]
    enough = np.bincount(label) >= max(MIN_EDGE_DENSITY * min_length, 3.0)
    renumbered = np.cumsum(enough) - 1
    keep = enough[label]
    order = np.argsort(label[keep], kind="stable")
    row, column, label = row[keep][order], column[keep][order], renumbered[label[keep][order]]
    a, b, c = (gradient[row + k, column].astype(float) for k in (-1, 0, 1))
    bend = a - 2.0 * b + c
    shift = np.where(bend < -1e-9, 0.5 * (a - c) / np.where(bend < -1e-9, bend, 1.0), 0.0)
    return _Chains(column, row + np.clip(shift, -0.5, 0.5), label.astype(np.intp))


def _fit_chains(
    strips: _Strips, chains: _Chains, min_length: float
) -> tuple[Floats, Indices]:
    """Fit a line to each chain by reweighted least squares (Geman-McClure); drop those too short, bent or turned.

    Returns:
        Segments (n, 2, 2) [px], and the prediction (n,) of each.
    """
    column, row, label = chains.column, chains.row, chains.label
    if not len(label):
        return np.zeros((0, 2, 2)), np.zeros(0, np.intp)
    n = int(label.max()) + 1
    offset, slope, weight = np.zeros(n), np.zeros(n), np.ones(len(row))
    for _ in range(CHAIN_ITERATIONS):
        mass = np.bincount(label, weight, n)
        safe = np.maximum(mass, 1e-9)
        mean_c, mean_r = np.bincount(label, weight * column, n) / safe, np.bincount(label, weight * row, n) / safe
        dc, dr = column - mean_c[label], row - mean_r[label]
        slope = np.bincount(label, weight * dc * dr, n) / np.maximum(np.bincount(label, weight * dc * dc, n), 1e-9)
        offset = mean_r - slope * mean_c
        residual = row - offset[label] - slope[label] * column
        weight = 1.0 / (1.0 + (residual / CHAIN_SCALE_PX) ** 2) ** 2
    on_line = np.abs(residual) < MAX_CHAIN_RESIDUAL_PX
    start = np.flatnonzero(np.diff(label, prepend=-1))
    low = np.minimum.reduceat(np.where(on_line, column, np.inf), start)
    high = np.maximum.reduceat(np.where(on_line, column, -np.inf), start)
    count = np.bincount(label[on_line], minlength=n)
    length = high - low + 1.0
    good = (count >= 3) & (length >= min_length) & (count >= MIN_EDGE_DENSITY * length)
    good &= np.abs(slope) <= np.tan(MAX_BAND_TURN_RAD)
    which = np.flatnonzero(good)
    ends = np.stack([_to_image(strips, c[which], (offset + slope * c)[which]) for c in (low, high)], axis=1)
    owner = np.zeros(n, np.intp)
    owner[label] = strips.owner[column]
    return ends, owner[which]


def _to_image(strips: _Strips, column: Floats, row: Floats) -> Floats:
    """Places (n, 2) in the image [px] of canvas places: columns are whole, rows continue linearly."""
    c = column.astype(np.intp)
    step = np.stack([strips.x[1, c] - strips.x[0, c], strips.y[1, c] - strips.y[0, c]], axis=1)
    return np.asarray(np.stack([strips.x[0, c], strips.y[0, c]], axis=1) + row[:, None] * step)
