"""What surfaces look like close up: procedural textures from integer hashes, and the blending of a pixel's samples.

A texture is a brightness factor near 1 at plane coordinates (s, t) [m], averaged over the pixel's footprint: joints and
stripes by their exact box integral, noise by fading out as its cells become smaller than the pixel. Contrast on walls,
floors and ceilings is low, so that the building's own edges are the strong ones; a poster is loud.

Jitted functions of this file call only one another, because numba's cache does not follow calls into other files.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

TEXTURES = ("plain", "speckle", "wood", "brick", "tiles", "carpet", "stripes", "poster")
PLAIN, SPECKLE, WOOD, BRICK, TILES, CARPET, STRIPES, POSTER = range(8)

BACKGROUND = 0.35
"""Brightness where the building is open: nothing is seen."""


def texture_code(name: str) -> int:
    """The number of a texture.

    Raises:
        ValueError: no texture has this name.
    """
    if name not in TEXTURES:
        raise ValueError(f"expected a texture of {', '.join(TEXTURES)}, got {name!r}")
    return TEXTURES.index(name)


def noise_table() -> NDArray[np.float32]:
    """(256, 256) numbers in [-1, 1) that look random: a hash (the finaliser of murmur3) of each pair of integers."""
    i, j = np.meshgrid(np.arange(256, dtype=np.uint64), np.arange(256, dtype=np.uint64))
    h = i * np.uint64(0x9E3779B97F4A7C15) ^ j * np.uint64(0xC2B2AE3D27D4EB4F) ^ np.uint64(0x165667B19E3779F9)
    for factor in (0xFF51AFD7ED558CCD, 0xC4CEB9FE1A85EC53):
        h = (h ^ (h >> np.uint64(33))) * np.uint64(factor)
    return ((h >> np.uint64(40)).astype(np.float64) / 2.0**23 - 1.0).astype(np.float32)


@njit(cache=True, error_model="numpy", forceinline=True)
def _floor(x: float) -> int:
    """Down to a whole number, for x above -2^20; cheaper than math.floor."""
    return int(x + 1048576.0) - 1048576


@njit(cache=True, error_model="numpy", forceinline=True)
def _cell(table: Any, i: int, j: int, seed: int) -> float:
    """The random number of cell (i, j) of the texture with this seed."""
    value: float = table[(j + 59 * seed) & 255, (i + 113 * seed) & 255]
    return value


@njit(cache=True, error_model="numpy", forceinline=True)
def _fade(cells: float) -> float:
    """Contrast left of a texture when half the pixel's footprint covers this many of its cells."""
    return min(1.0, max(0.0, 1.25 - 1.25 * cells))


@njit(cache=True, error_model="numpy", forceinline=True)
def _noise(table: Any, s: float, t: float, seed: int) -> float:
    """Smooth noise in [-1, 1] with cells of size 1."""
    i, j = _floor(s), _floor(t)
    a, b = s - i, t - j
    a, b = a * a * (3.0 - 2.0 * a), b * b * (3.0 - 2.0 * b)
    low = _cell(table, i, j, seed) * (1.0 - a) + _cell(table, i + 1, j, seed) * a
    high = _cell(table, i, j + 1, seed) * (1.0 - a) + _cell(table, i + 1, j + 1, seed) * a
    return low * (1.0 - b) + high * b


@njit(cache=True, error_model="numpy", forceinline=True)
def _faded_noise(table: Any, s: float, t: float, half_s: float, half_t: float, seed: int) -> float:
    left = _fade(max(half_s, half_t))
    return left * _noise(table, s, t, seed) if left > 0.0 else 0.0


@njit(cache=True, error_model="numpy", forceinline=True)
def _pulse_integral(x: float, duty: float) -> float:
    """Integral from 0 to x of a wave of period 1 that is 1 on the first ``duty`` of each period."""
    whole = _floor(x)
    return whole * duty + min(x - whole, duty)


@njit(cache=True, error_model="numpy", forceinline=True)
def _pulse(x: float, half: float, duty: float) -> float:
    """That wave, averaged over x - half .. x + half."""
    half = max(half, 1e-6)
    return (_pulse_integral(x + half, duty) - _pulse_integral(x - half, duty)) / (2.0 * half)


@njit(cache=True, error_model="numpy", forceinline=True)
def _joints(s: float, t: float, half_s: float, half_t: float, duty_s: float, duty_t: float) -> float:
    """Coverage of a grid of joints that take ``duty`` of each cell."""
    return 1.0 - (1.0 - _pulse(s, half_s, duty_s)) * (1.0 - _pulse(t, half_t, duty_t))


@njit(cache=True, error_model="numpy")
def _brick(table: Any, s: float, t: float, half_s: float, half_t: float, seed: int) -> float:
    """Courses half as high as long; every second one is moved by half a brick."""
    t, half_t = 2.0 * t, 2.0 * half_t
    course = _floor(t)
    s = s + 0.5 * (course & 1)
    tone = 0.05 * _cell(table, _floor(s), course, seed) * _fade(max(half_s, half_t))
    joint = _joints(s, t, half_s, half_t, 0.05, 0.10)
    return (1.0 + tone) * (1.0 - joint) + 0.86 * joint


@njit(cache=True, error_model="numpy")
def _tiles(table: Any, s: float, t: float, half_s: float, half_t: float, seed: int) -> float:
    tone = 0.02 * _cell(table, _floor(s), _floor(t), seed) * _fade(max(half_s, half_t))
    joint = _joints(s, t, half_s, half_t, 0.03, 0.03)
    return (1.0 + tone) * (1.0 - joint) + 0.90 * joint


@njit(cache=True, error_model="numpy")
def _wood(table: Any, s: float, t: float, half_s: float, half_t: float, seed: int) -> float:
    """Grain along t."""
    coarse = _faded_noise(table, s, 0.08 * t, half_s, 0.08 * half_t, seed)
    fine = _faded_noise(table, 4.0 * s, 0.2 * t, 4.0 * half_s, 0.2 * half_t, seed + 1)
    return 1.0 + 0.05 * coarse + 0.03 * fine


@njit(cache=True, error_model="numpy")
def _block_mean(table: Any, s: float, t: float, half_s: float, half_t: float, seed: int) -> float:
    """A patchwork of unit cells of random brightness in [-1, 1], averaged over the footprint (exact below one cell)."""
    i, j = _floor(s - half_s), _floor(t - half_t)
    a = min(1.0, max(0.0, (s + half_s - i - 1.0) / max(2.0 * half_s, 1e-6)))
    b = min(1.0, max(0.0, (t + half_t - j - 1.0) / max(2.0 * half_t, 1e-6)))
    low = _cell(table, i, j, seed) * (1.0 - a) + _cell(table, i + 1, j, seed) * a
    high = _cell(table, i, j + 1, seed) * (1.0 - a) + _cell(table, i + 1, j + 1, seed) * a
    return (low * (1.0 - b) + high * b) * _fade(0.5 * max(half_s, half_t))


@njit(cache=True, error_model="numpy")
def _poster(table: Any, s: float, t: float, half_s: float, half_t: float, seed: int, channel: int) -> float:
    """Large blocks of colour with rows of small dark ones, as print."""
    block = _block_mean(table, s, t, half_s, half_t, seed + 7 * channel)
    print_ = _block_mean(table, 4.0 * s, 8.0 * t, 4.0 * half_s, 8.0 * half_t, seed + 101)
    return 1.0 + 0.45 * block + 0.2 * min(0.0, print_)


@njit(cache=True, error_model="numpy", forceinline=True)
def _texture(table: Any, code: int, s: float, t: float, half_s: float, half_t: float, seed: int) -> float:
    """Brightness factor of a texture at (s, t), in units of its scale, over a footprint of +- half."""
    if code == SPECKLE:
        return (1.0 + 0.03 * _faded_noise(table, s, t, half_s, half_t, seed)
                + 0.025 * _faded_noise(table, 0.13 * s, 0.13 * t, 0.13 * half_s, 0.13 * half_t, seed + 1))
    if code == WOOD:
        return _wood(table, s, t, half_s, half_t, seed)
    if code == BRICK:
        return _brick(table, s, t, half_s, half_t, seed)
    if code == TILES:
        return _tiles(table, s, t, half_s, half_t, seed)
    if code == CARPET:
        return (1.0 + 0.06 * _faded_noise(table, s, t, half_s, half_t, seed)
                + 0.03 * _faded_noise(table, 0.1 * s, 0.1 * t, 0.1 * half_s, 0.1 * half_t, seed + 1))
    if code == STRIPES:
        return 0.94 + 0.12 * _pulse(s, half_s, 0.5)
    return 1.0 + 0.015 * _faded_noise(table, 0.2 * s, 0.2 * t, 0.2 * half_s, 0.2 * half_t, seed)


@njit(cache=True, error_model="numpy", forceinline=True)
def _colour(look: Any, u: float, v: float, table: Any, haze_per_m: float) -> Any:
    """(red, green, blue) of a patch as seen round pixel (u, v); ``look`` is its row of :func:`shade`."""
    z = 1.0 / max(look[0] * u + look[1] * v + look[2], 1e-4)
    s = z * (look[3] * u + look[4] * v + look[5])
    t = z * (look[6] * u + look[7] * v + look[8])
    cells = 0.5 * z * look[11]
    half_s = cells * (abs(look[3] - s * look[0]) + abs(look[4] - s * look[1]))
    half_t = cells * (abs(look[6] - t * look[0]) + abs(look[7] - t * look[1]))
    s, t = (s + look[9]) * look[11], (t + look[10]) * look[11]
    code, seed = int(look[15]), int(look[16])
    dim = 1.0 / (1.0 + haze_per_m * z)
    if code == POSTER:
        return (look[12] * dim * _poster(table, s, t, half_s, half_t, seed, 0),
                look[13] * dim * _poster(table, s, t, half_s, half_t, seed, 1),
                look[14] * dim * _poster(table, s, t, half_s, half_t, seed, 2))
    dim *= _texture(table, code, s, t, half_s, half_t, seed)
    return look[12] * dim, look[13] * dim, look[14] * dim


@njit(cache=True, error_model="numpy")
def _mixed_colour(seen: Any, x: int, y: int, offsets: Any, looks: Any, table: Any, haze_per_m: float, done: Any) -> Any:
    """Colour of a pixel whose samples ``seen`` (N,) differ: each patch is shaded once, amid its own samples."""
    samples = len(offsets)
    red, green, blue = 0.0, 0.0, 0.0
    done[:] = False
    for r in range(samples):
        if done[r]:
            continue
        count, u, v = 0, 0.0, 0.0
        for q in range(r, samples):
            if seen[q] == seen[r]:
                done[q] = True
                count += 1
                u += offsets[q]
                v += (q + 0.5) / samples - 0.5
        one = (BACKGROUND, BACKGROUND, BACKGROUND)
        if seen[r] >= 0:
            one = _colour(looks[seen[r]], x + u / count, y + v / count, table, haze_per_m)
        weight = count / samples
        red, green, blue = red + weight * one[0], green + weight * one[1], blue + weight * one[2]
    return red, green, blue


@njit(cache=True, error_model="numpy")
def _find_mixed(seen: Any, mixed: Any) -> None:
    """Which pixels of a row see more than one patch, or nothing, at their samples (N, width): those not set to 0."""
    for x in range(len(mixed)):
        mixed[x] = seen[0, x] & np.int16(-32768)
    for r in range(1, len(seen)):
        for x in range(len(mixed)):
            mixed[x] |= seen[r, x] ^ seen[0, x]


@njit(cache=True, error_model="numpy")
def shade(seen: Any, offsets: Any, looks: Any, table: Any, haze_per_m: float) -> Any:
    """The image (height, width, 3) float32, 0..1, of the patches seen at the samples (height, N, width).

    ``looks`` (P, 17) says of each patch: the forms of 1/z, s z^-1 and t z^-1 (9), the texture's base (2), cells a
    metre, lit colour (3), texture code and seed.
    """
    height, samples, width = seen.shape
    image = np.empty((height, width, 3), np.float32)
    mixed = np.empty(width, np.int16)
    done = np.empty(samples, np.bool_)
    for y in range(height):
        _find_mixed(seen[y], mixed)
        for x in range(width):
            if mixed[x] != 0:
                rgb = _mixed_colour(seen[y, :, x], x, y, offsets, looks, table, haze_per_m, done)
            else:
                rgb = _colour(looks[seen[y, 0, x]], float(x), float(y), table, haze_per_m)
            for c in range(3):
                image[y, x, c] = min(1.0, rgb[c])
    return image
