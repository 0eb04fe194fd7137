"""A large problem of the matcher with six unknowns: 300 model lines, 4,500 segments, and priors of three widths."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.matching import match_in_space
from world_models.camera import Camera
from world_models.frames import Pose

Array = NDArray[np.float64]

MODEL, DATA = 300, 4500
CAMERA = Camera.from_field_of_view(np.radians(65.0))
NOISE_PX = 0.4
PRIORS = ((0.15, 0.02), (0.3, 0.05), (1.0, 0.1))
"""Standard deviations of the prior [m] and [rad] on each axis."""
MAX_S = 2.0


def measure_large(seed: int) -> list[tuple[str, int, float]]:
    """For each prior what it is, how many pairs are matched, and the processor time of the match [s]."""
    rng = np.random.default_rng([seed, MODEL, DATA])
    lines, data = generate_large(rng)
    out = []
    for spread_m, spread_rad in PRIORS:
        covariance = np.diag([spread_rad**2] * 3 + [spread_m**2] * 3)
        prior = Pose.from_rotation_vector(*(rng.uniform(-s, s, 3) for s in (spread_rad, spread_m)))
        match_in_space(lines[:5], data[:20], CAMERA, prior, covariance)  # compiles
        before = time.process_time()
        match = match_in_space(lines, data, CAMERA, prior, covariance)
        out.append((f"prior of {spread_m:g} m and {spread_rad:g} rad", len(match.pairs), time.process_time() - before))
    return out


def generate_large(rng: np.random.Generator) -> tuple[Array, Array]:
    """Model lines (300, 2, 3) [m] along three axes, and the segments (4500, 2, 2) [px] of those in view and clutter."""
    start = rng.uniform([-4.0, -3.0, 4.0], [4.0, 3.0, 14.0], (MODEL, 3))
    along = np.eye(3)[rng.integers(0, 3, MODEL)] * rng.uniform(0.3, 2.0, (MODEL, 1))
    lines = np.stack([start, start + along], axis=1)
    px, visible = CAMERA.project_segments(lines, Pose.identity())
    seen = px[visible] + rng.normal(0.0, NOISE_PX, px[visible].shape)
    count = DATA - len(seen)
    middle = rng.uniform(0.0, 511.0, (count, 2))
    angle = rng.choice([0.0, 0.5 * np.pi, 0.3, -0.3, 1.0], count) + rng.normal(0.0, 0.05, count)
    half = 0.5 * rng.uniform(10.0, 60.0, (count, 1)) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return lines, np.concatenate([seen, np.stack([middle - half, middle + half], axis=1)])
