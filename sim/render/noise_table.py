"""Value noise for the textures: a table of random numbers, the same on every machine."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


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
