"""Missions on generated floors with a camera that is not mounted as told, or that is knocked on the way."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Literal

import numpy as np

from sim.differences.inexact import TrueInexact
from sim.made_up.inexact_missions import write_inexact_mission

CameraCase = Literal["as told", "miscalibrated", "knocked"]
CASES: tuple[CameraCase, ...] = ("as told", "miscalibrated", "knocked")
MAX_TURN_RAD, MAX_HEIGHT_M, MAX_FOCAL = math.radians(3.0), 0.08, 0.04
"""Largest errors of tilt, roll and yaw; of the height; and of the focal length, as a part of it."""
FOCAL_PX = 401.84
"""Focal length of a scenario's camera."""
KNOCK_M = (1.0, 5.0)
"""Between which lengths of the way a camera is knocked."""
EXACT = TrueInexact()


def write_camera_mission(folder: Path, seed: int, case: CameraCase) -> Path:
    """Write a scenario with the floor's files; returns its path. The same for the same arguments."""
    rng = np.random.default_rng([seed, 7])
    tilt, roll, yaw, height, focal, after = rng.uniform(-1.0, 1.0, 6)
    turn = "".join(f"{name}_deg = {math.degrees(MAX_TURN_RAD) * part:.4f}\n" for name, part in (
        ("tilt", tilt), ("roll", roll), ("yaw", yaw)))
    low, high = KNOCK_M
    more = {
        "as told": "",
        "miscalibrated": f"\n[truth.camera]\n{turn}height_m = {MAX_HEIGHT_M * height:.4f}\n"
                         f"focal_px = {MAX_FOCAL * FOCAL_PX * focal:.3f}\n",
        "knocked": f'\n[[faults]]\nkind = "camera_knocked"\nafter_m = {low + (high - low) * abs(after):.2f}\n{turn}',
    }[case]
    return write_inexact_mission(folder, seed, EXACT, more=more)
