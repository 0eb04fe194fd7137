"""The camera's yaw as learnt from ways is no further off than stated: after one way, after a chain, on bent wheels.

The board is left out: what the knowledge source asks it for is given. It states more than its error on purpose: the
headings of a way may share an error.
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from consistency import assert_soon_consistent
from knowledge_sources.senses.yaw_calibrator import YawCalibrator
from world_models.entries import Travel, begin_travel
from world_models.frames import Pose2

AT_FIRST_RAD, PLACE_M, HEADING_RAD = 0.03, 0.01, 0.003
COVARIANCE = np.diag([PLACE_M, PLACE_M, HEADING_RAD]) ** 2
STEP_M, STEPS, SURPLUS = 0.5, 9, 4.0


def learn(seed: int, ways: int, noise: float, bend_per_m: float) -> float:
    """Squared error of the yaw over its variance, after so many ways one after the other."""
    rng = np.random.default_rng(seed)
    yaw, believed, variance = rng.normal(0.0, AT_FIRST_RAD), 0.0, AT_FIRST_RAD**2
    true = Pose2(0.0, 0.0, rng.uniform(-3.0, 3.0))

    def look() -> Pose2:
        x, y = noise * rng.normal(0.0, PLACE_M, 2)
        return Pose2(true.x_m + x, true.y_m + y, true.heading_rad + yaw - believed + noise * rng.normal(0, HEADING_RAD))

    for _ in range(ways):
        camera: Any = SimpleNamespace(mount=SimpleNamespace(yaw_rad=believed))
        seen = look()
        way: Travel = begin_travel(seen, COVARIANCE, believed, variance)
        for _ in range(STEPS):
            bend = rng.normal(0.0, bend_per_m) * STEP_M
            way = way.after_motion(seen, seen @ Pose2(STEP_M, 0.0, 0.0), 0.0)
            true = true @ Pose2(STEP_M * math.cos(bend / 2.0), STEP_M * math.sin(bend / 2.0), bend)
            seen = look()
        held: Any = SimpleNamespace(pose=seen, covariance=COVARIANCE)
        found = YawCalibrator()._measure(camera, way, held)
        if found is not None:
            believed, variance = believed + found.step_rad, found.variance
    return (yaw - believed) ** 2 / variance


@pytest.mark.parametrize(("ways", "noise", "bend_per_m"), [
    (1, 1.0, 0.0), (1, 1.0, 0.05), (1, 1.5, 0.02), (3, 1.0, 0.02), (3, 1.5, 0.02)])
def test_the_yaw_is_no_further_off_than_it_says(ways: int, noise: float, bend_per_m: float) -> None:
    assert_soon_consistent(lambda seed: learn(seed, ways, noise, bend_per_m), 200, 1, most_surplus=SURPLUS)
