"""Whether the lens bends as it is told: lines that were found fit a pose, but are displaced as a wrong lens does it.

A wrong term of the lens moves the pose by decimetres and leaves residuals of half a pixel, which no verdict minds. They
grow with the cube of the distance from the centre, as no pose and no mounting makes them grow.
"""

from __future__ import annotations

import math
import statistics
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from blackboard import View
from knowledge_sources.reads import find_belief, find_robot
from world_models.camera import Camera, CameraMount, move_camera
from world_models.entries import Certificate, LineMatch
from world_models.frames import Pose2

MOST_DEVIATIONS = 5.0
"""A lens that is off by more is another one."""
MIN_PICTURES, MIN_LINES = 3, 20
SIGMA_PX = 0.35
"""Of the ends of a segment."""
WEAK = np.array([0.5, 0.5, 0.5, 0.02, 0.02, 1e-4, 0.03, 0.02, 6.0, 6.0, 10.0])
"""How much is left open of pose [m, rad], camera (:data:`world_models.camera.CAMERA_UNKNOWNS`) and first term."""
STEP, ROUNDS = 1e-5, 3
Floats = NDArray[np.float64]


@dataclass
class LensWatch:
    """Collects what verified pictures say of the first term of the lens.

    Attributes:
        offs: of each picture by how much the term is off, and the standard deviation of that.
    """

    offs: list[tuple[float, float]] = field(default_factory=list)
    _last: str = ""

    def take(self, view: View) -> None:
        """See what the newest certificate rests on."""
        verdict, belief = view.latest(Certificate), find_belief(view)
        if verdict is None or belief is None or verdict.id == self._last or verdict.value.verdict != "verified":
            return
        self._last = verdict.id
        fix = view.get(verdict.value.fix)
        match = None if fix is None else view.get(fix.value.match)
        if fix is None or match is None or np.count_nonzero(fix.value.inliers) < MIN_LINES:
            return
        robot, found = find_robot(view).on_floor_of(belief.value.locale), match.value
        self.offs.append(measure_lens(found, fix.value.inliers, fix.value.world_from_robot, robot.camera, robot.mount))

    def find_fault(self) -> str:
        """What is wrong with the lens, in words; "" where nothing is known to be."""
        if len(self.offs) < MIN_PICTURES:
            return ""
        off = statistics.median(value for value, _ in self.offs)
        spread = 1.25 * 1.48 * statistics.median(abs(value - off) for value, _ in self.offs) / math.sqrt(len(self.offs))
        sigma = max(statistics.median(sigma for _, sigma in self.offs), spread)
        if abs(off) <= MOST_DEVIATIONS * sigma:
            return ""
        return (f"the lens bends differently than told: by the lines of {len(self.offs)} pictures its first term, k1, "
                f"is off by {off:+.3f} +- {sigma:.3f}: no certificate counts")


def measure_lens(
    match: LineMatch, inliers: NDArray[np.bool_], pose: Pose2, camera: Camera, mount: CameraMount
) -> tuple[float, float]:
    """By how much the first term of the lens is off, and its standard deviation, with pose and camera left open."""
    lines, segments = match.lines_world[inliers], match.segments_px[inliers]
    start = np.array([pose.x_m, pose.y_m, pose.heading_rad, *np.zeros(8)])
    state = start
    for _ in range(ROUNDS):
        away = _measure(lines, segments, state, camera, mount)
        slopes = np.stack([(_measure(lines, segments, state + step, camera, mount)
                            - _measure(lines, segments, state - step, camera, mount)) / (2.0 * STEP)
                           for step in STEP * np.eye(len(state))], axis=1)
        weights = np.minimum(1.0, 1.0 / np.maximum(np.abs(away), 1e-9)) / SIGMA_PX**2  # Huber's, at a pixel
        known = WEAK**-2.0
        information = slopes.T @ (weights[:, None] * slopes) + np.diag(known)
        state = state - np.linalg.solve(information, slopes.T @ (weights * away) + known * (state - start))
    return float(state[-1]), float(np.linalg.inv(information)[-1, -1] ** 0.5)


def _measure(lines: Floats, segments: Floats, state: Floats, camera: Camera, mount: CameraMount) -> Floats:
    """Distances (2 n) of the ends of segments (n, 2, 2) from the projected lines (n, 2, 3) [px], for a state (11,)."""
    x, y, heading = state[:3]
    lens, placed = move_camera(camera, mount, state[3:10])
    c, s = np.cos(heading), np.sin(heading)
    in_robot = (lines.reshape(-1, 3) - (x, y, 0.0)) @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    ends = placed.camera_from_robot.apply(in_robot).reshape(-1, 2, 3) @ lens.matrix.T
    line = np.cross(ends[:, 0], ends[:, 1])
    line /= np.linalg.norm(line[:, :2], axis=1)[:, None]
    centre, focal = np.array([lens.cx, lens.cy]), np.array([lens.fx, lens.fy])
    plane = (segments - centre) / focal
    seen = plane * (1.0 - state[10] * np.sum(plane**2, axis=-1, keepdims=True)) * focal + centre
    return np.asarray(np.einsum("nij,nj->ni", seen, line[:, :2]) + line[:, 2:]).ravel()
