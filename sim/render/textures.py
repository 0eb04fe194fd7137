"""Procedural textures: the brightness of a surface from value noise.

A texture is a brightness factor near 1 at plane coordinates (s, t) [m], averaged over the pixel's footprint: joints and
stripes by the exact box integral, noise by fading out where its cells become smaller than the pixel. Contrast on walls,
floors and ceilings is low, so that the strong edges are those of the building; a poster has high contrast.

Each step is done for a batch of points of one patch. LLVM vectorizes short loops in single precision with the table
lookups kept apart, which is three times as fast. Functions with :class:`Points` as argument are inlined, as passing
them takes a microsecond. Compiled functions of this file call only one another, because numba's cache does not follow
calls into other files.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from world_models.compiled import compiled, inlined

TEXTURES = ("plain", "speckle", "wood", "brick", "tiles", "carpet", "stripes", "poster")
PLAIN, SPECKLE, WOOD, BRICK, TILES, CARPET, STRIPES, POSTER = range(8)

SKY = (0.62, 0.72, 0.84)
"""Red, green and blue of the background, which is never seen indoors."""

BATCH = 512
"""Points of a batch: few enough for the first-level cache."""

ZERO, HALF, ONE, TWO, THREE, FADE = (np.float32(x) for x in (0.0, 0.5, 1.0, 2.0, 3.0, 1.25))
MIN_HALF = np.float32(1e-6)
"""Floor of half a footprint, as a divisor."""
MIN_INVERSE_DEPTH = np.float32(1e-4)
"""Floor of 1/z [1/m], as a divisor."""
LAST_COLUMN, ROW_LENGTH = np.int32(255), np.int32(256)
"""Of the table of random cells."""


class Points(NamedTuple):
    """Arrays (n,) float32 for n points of one patch.

    Attributes:
        u, v: pixel.
        z: depth [m].
        s, t: texture coordinates in units of the texture's scale.
        half_s, half_t: half the pixel's footprint, in the same units.
        tone: the texture's brightness factor.
        a, b: place in a random cell; ``cell`` is its place in the table (uint32).
        left: contrast that is left of the cells, 0..1; ``value`` is their noise times this.
    """

    u: Any
    v: Any
    z: Any
    s: Any
    t: Any
    half_s: Any
    half_t: Any
    tone: Any
    a: Any
    b: Any
    left: Any
    value: Any
    cell: Any


def texture_code(name: str) -> int:
    """The number of a texture.

    Raises:
        ValueError: no texture has this name.
    """
    if name not in TEXTURES:
        raise ValueError(f"expected a texture of {', '.join(TEXTURES)}, got {name!r}")
    return TEXTURES.index(name)


@inlined
def _set_fade(p: Any, n: int, along_s: float, along_t: float) -> bool:
    """Find the contrast that the footprints leave at so many cells a unit; returns whether there is any."""
    fs, ft = np.float32(along_s), np.float32(along_t)
    for k in range(n):
        p.left[k] = np.maximum(ZERO, np.minimum(ONE, FADE - FADE * np.maximum(fs * p.half_s[k], ft * p.half_t[k])))
    return bool(p.left[:n].any())


@inlined
def _cell(i: Any, j: Any, seed: int) -> Any:
    """Index in the table of the cell (i, j), whole float32 numbers, of the texture with this seed."""
    column = np.int32(np.int32(i) + np.int32(113 * seed)) & LAST_COLUMN
    return np.uint32(column + ROW_LENGTH * (np.int32(np.int32(j) + np.int32(59 * seed)) & LAST_COLUMN))


@inlined
def _look_up(p: Any, n: int, table: Any) -> None:
    """The noise ``value`` at the place (a, b) in a cell, times the contrast that is left."""
    for k in range(n):
        c = table[p.cell[k]]
        p.value[k] = p.left[k] * (c[0] + p.a[k] * c[1] + p.b[k] * (c[2] + p.a[k] * c[3]))


@inlined
def _add_noise(p: Any, n: int, table: Any, along_s: float, along_t: float, contrast: float, seed: int) -> None:
    """Add smooth noise with ``along_s`` x ``along_t`` cells a unit to the tone."""
    fs, ft, strength = np.float32(along_s), np.float32(along_t), np.float32(contrast)
    if not _set_fade(p, n, along_s, along_t):
        return
    for k in range(n):
        s, t = fs * p.s[k], ft * p.t[k]
        i, j = np.floor(s), np.floor(t)
        a, b = s - i, t - j
        p.a[k], p.b[k] = a * a * (THREE - TWO * a), b * b * (THREE - TWO * b)
        p.cell[k] = _cell(i, j, seed)
    _look_up(p, n, table)
    for k in range(n):
        p.tone[k] += strength * p.value[k]


@inlined
def _overlap(s: Any, half: Any, i: Any) -> Any:
    """The part of the interval s - half .. s + half, which begins in cell i, beyond that cell."""
    return np.minimum(ONE, np.maximum(ZERO, (s + half - i - ONE) / np.maximum(TWO * half, MIN_HALF)))


@inlined
def _find_blocks(p: Any, n: int, table: Any, along_s: float, along_t: float, seed: int) -> None:
    """A patchwork of cells of random brightness in [-1, 1], averaged over the footprint (exact below one cell)."""
    fs, ft = np.float32(along_s), np.float32(along_t)
    _set_fade(p, n, 0.5 * along_s, 0.5 * along_t)
    for k in range(n):
        s, t, half_s, half_t = fs * p.s[k], ft * p.t[k], fs * p.half_s[k], ft * p.half_t[k]
        i, j = np.floor(s - half_s), np.floor(t - half_t)
        p.a[k], p.b[k] = _overlap(s, half_s, i), _overlap(t, half_t, j)
        p.cell[k] = _cell(i, j, seed)
    _look_up(p, n, table)


@inlined
def _add_poster(p: Any, n: int, table: Any, seed: int, channel: int) -> None:
    """A poster: large blocks of colour with rows of small dark ones, like print."""
    _find_blocks(p, n, table, 1.0, 1.0, seed + 7 * channel)
    for k in range(n):
        p.tone[k] += np.float32(0.45) * p.value[k]
    _find_blocks(p, n, table, 4.0, 8.0, seed + 101)
    for k in range(n):
        p.tone[k] += np.float32(0.2) * np.minimum(ZERO, p.value[k])


@inlined
def _pulse(x: Any, half: Any, duty: Any) -> Any:
    """A square wave of period 1, which is 1 on the first ``duty`` of it, averaged over x - half .. x + half."""
    half = np.maximum(half, MIN_HALF)
    low, high = x - half, x + half
    i, j = np.floor(low), np.floor(high)
    return ((j - i) * duty + np.minimum(high - j, duty) - np.minimum(low - i, duty)) / (TWO * half)


@inlined
def _add_grid(p: Any, n: int, table: Any, bond: float, courses: float, joint: tuple[float, float], contrast: float,
              dark: float, seed: int) -> None:
    """Bricks or tiles of random tone, and ``dark`` joints that take these parts of their length and height.

    There are ``courses`` rows a unit, and every second one is shifted by ``bond``.
    """
    move, ft, strength, grey = np.float32(bond), np.float32(courses), np.float32(contrast), np.float32(dark)
    duty_s, duty_t = np.float32(joint[0]), np.float32(joint[1])
    _set_fade(p, n, 1.0, courses)
    p.a[:n], p.b[:n] = ZERO, ZERO
    for k in range(n):
        course = np.floor(ft * p.t[k])
        p.s[k] += move * (course - TWO * np.floor(HALF * course))
        p.cell[k] = _cell(np.floor(p.s[k]), course, seed)
    _look_up(p, n, table)
    for k in range(n):
        p.a[k] = ONE - _pulse(p.s[k], p.half_s[k], duty_s)
    for k in range(n):
        p.b[k] = ONE - _pulse(ft * p.t[k], ft * p.half_t[k], duty_t)
    for k in range(n):
        p.tone[k] = grey + (p.tone[k] + strength * p.value[k] - grey) * p.a[k] * p.b[k]


@inlined
def _find_tone(p: Any, n: int, table: Any, code: int, seed: int, channel: int) -> None:
    """The texture's brightness factor at n points."""
    p.tone[:n] = ONE
    if code == PLAIN:
        _add_noise(p, n, table, 0.2, 0.2, 0.015, seed)
    elif code == SPECKLE:
        _add_noise(p, n, table, 1.0, 1.0, 0.03, seed)
        _add_noise(p, n, table, 0.13, 0.13, 0.025, seed + 1)
    elif code == CARPET:
        _add_noise(p, n, table, 1.0, 1.0, 0.06, seed)
        _add_noise(p, n, table, 0.1, 0.1, 0.03, seed + 1)
    elif code == WOOD:  # with its grain along t
        _add_noise(p, n, table, 1.0, 0.08, 0.05, seed)
        _add_noise(p, n, table, 4.0, 0.2, 0.03, seed + 1)
    elif code == BRICK:
        _add_grid(p, n, table, 0.5, 2.0, (0.05, 0.10), 0.05, 0.86, seed)
    elif code == TILES:
        _add_grid(p, n, table, 0.0, 1.0, (0.03, 0.03), 0.02, 0.90, seed)
    elif code == STRIPES:
        for k in range(n):
            p.tone[k] = np.float32(0.94) + np.float32(0.12) * _pulse(p.s[k], p.half_s[k], HALF)
    else:
        _add_poster(p, n, table, seed, channel)


@inlined
def _locate(p: Any, n: int, appearance: Any) -> None:
    """Find texture coordinates and footprints of n pixels (u, v); ``appearance`` is a row of :func:`shade`'s."""
    f = appearance.astype(np.float32)
    scale = f[11]
    base_s, base_t = np.float32(appearance[9] * appearance[11]), np.float32(appearance[10] * appearance[11])
    for k in range(n):
        p.z[k] = ONE / np.maximum(f[0] * p.u[k] + f[1] * p.v[k] + f[2], MIN_INVERSE_DEPTH)
    for k in range(n):
        p.s[k] = p.z[k] * (f[3] * p.u[k] + f[4] * p.v[k] + f[5])
    for k in range(n):
        p.t[k] = p.z[k] * (f[6] * p.u[k] + f[7] * p.v[k] + f[8])
    for k in range(n):
        spread = abs(f[3] - p.s[k] * f[0]) + abs(f[4] - p.s[k] * f[1])
        p.half_s[k] = HALF * p.z[k] * scale * spread
        p.s[k] = p.s[k] * scale + base_s
    for k in range(n):
        spread = abs(f[6] - p.t[k] * f[0]) + abs(f[7] - p.t[k] * f[1])
        p.half_t[k] = HALF * p.z[k] * scale * spread
        p.t[k] = p.t[k] * scale + base_t


@inlined
def _find_colours(p: Any, n: int, appearance: Any, table: Any, haze_per_m: float, colours: Any) -> None:
    """Colours (3, n) of a patch at n pixels (u, v)."""
    _locate(p, n, appearance)
    code, seed, haze = int(appearance[15]), int(appearance[16]), np.float32(haze_per_m)
    for channel in range(3):
        if channel == 0 or code == POSTER:
            _find_tone(p, n, table, code, seed, channel)
        light = np.float32(appearance[12 + channel])
        for k in range(n):
            colours[channel, k] = np.minimum(ONE, light * p.tone[k] / (ONE + haze * p.z[k]))


@compiled
def _points(n: int) -> Any:
    f = np.empty((12, n), np.float32)
    return Points(f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8], f[9], f[10], f[11], np.empty(n, np.uint32))


@compiled
def background(bare: Any) -> Any:
    """The image (height, width, 3) float32 of the background alone; ``bare`` is the part of each pixel that sees it."""
    image = np.empty((*bare.shape, 3), np.float32)
    for y in range(image.shape[0]):
        for x in range(image.shape[1]):
            for c in range(3):
                image[y, x, c] = np.float32(SKY[c]) * bare[y, x]
    return image


@compiled
def shade(pieces: Any, appearances: Any, table: Any, haze_per_m: float) -> Any:
    """The image (height, width, 3) float32, 0..1, of :class:`sim.render.pieces.Pieces`.

    ``appearances`` (P, 17) holds of each patch: the forms of 1/z, s z^-1 and t z^-1 (9), the texture's base (2), cells
    per metre, lit colour (3), texture code and seed.
    """
    image = background(pieces.bare)
    p, colours = _points(BATCH + image.shape[1]), np.empty((3, BATCH + image.shape[1]), np.float32)
    for patch in range(len(appearances)):
        start, last = pieces.first[patch], pieces.first[patch + 1]
        while start < last:
            n, end = _gather(pieces, start, last, p)
            _find_colours(p, n, appearances[patch], table, haze_per_m, colours)
            _scatter(pieces, start, end, colours, image)
            start = end
    return image


@compiled
def shade_pieces(pieces: Any, appearances: Any, table: Any, haze_per_m: float) -> Any:
    """The colours (n, 3) of the pixels of all pieces, in the order of ``pieces.order``; see :func:`shade`."""
    out, at = np.empty((np.sum(pieces.length), 3), np.float32), 0
    p, colours = _points(BATCH + len(pieces.bare[0])), np.empty((3, BATCH + len(pieces.bare[0])), np.float32)
    for patch in range(len(appearances)):
        start, last = pieces.first[patch], pieces.first[patch + 1]
        while start < last:
            n, start = _gather(pieces, start, last, p)
            _find_colours(p, n, appearances[patch], table, haze_per_m, colours)
            for k in range(n):
                for c in range(3):
                    out[at + k, c] = colours[c, k]
            at += n
    return out


@compiled
def _gather(pieces: Any, start: int, last: int, p: Any) -> Any:
    """Read the pixels (u, v) of a batch of pieces; returns their number and the first piece of the next batch."""
    n = 0
    while start < last and n < BATCH:
        i = pieces.order[start]
        for k in range(pieces.length[i]):
            p.u[n + k], p.v[n + k] = pieces.u[i] + np.float32(k), pieces.v[i]
        n += pieces.length[i]
        start += 1
    return n, start


@compiled
def _scatter(pieces: Any, start: int, end: int, colours: Any, image: Any) -> None:
    """Add the colours (3, n) of a batch of pieces to the image."""
    n = 0
    for e in range(start, end):
        i = pieces.order[e]
        row, column, weight = image[pieces.row[i]], pieces.column[i], pieces.weight[i]
        for k in range(pieces.length[i]):
            for c in range(3):
                row[column + k, c] += weight * colours[c, n + k]
        n += pieces.length[i]


def build_noise_table() -> NDArray[np.float32]:
    """The table (65536, 4) of bilinear forms of a 256 x 256 grid of value noise.

    In cell 256 j + i the noise is c0 + c1 a + c2 b + c3 a b, for a and b from 0 to 1. At the corners it is in [-1, 1]:
    a hash (the finalizer of MurmurHash3) of the pair of integers.
    """
    i, j = np.meshgrid(np.arange(256, dtype=np.uint64), np.arange(256, dtype=np.uint64))
    h = i * np.uint64(0x9E3779B97F4A7C15) ^ j * np.uint64(0xC2B2AE3D27D4EB4F) ^ np.uint64(0x165667B19E3779F9)
    for factor in (0xFF51AFD7ED558CCD, 0xC4CEB9FE1A85EC53):
        h = (h ^ (h >> np.uint64(33))) * np.uint64(factor)
    corner = (h >> np.uint64(40)).astype(np.float64) / 2.0**23 - 1.0
    right, below = np.roll(corner, -1, axis=1), np.roll(corner, -1, axis=0)
    opposite = np.roll(below, -1, axis=1)
    forms = np.stack([corner, right - corner, below - corner, opposite - below - right + corner], axis=-1)
    return forms.reshape(-1, 4).astype(np.float32)
