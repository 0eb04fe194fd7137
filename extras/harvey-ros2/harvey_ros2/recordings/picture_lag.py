"""How late pictures are: what they say of a motion is compared with the odometry of a while before.

Stamps that are given on arrival, or by another clock, are late by what nobody says. At a constant speed that moves
every place by the same; where the robot starts, turns and stops, pictures and odometry disagree for that while.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from world_models.frames import Pose2, wrap_angle

LAGS_S = np.arange(-20, 41) * 0.025
"""By how much a picture may be older than its stamp [s]; less than 0: by how much the odometry is."""
BEFORE_SIGMA_S = 0.15
"""What is known of that beforehand, one standard deviation [s]."""
LEAST_SIGMA_S = 0.0125
"""It is not told better than that: half a step [s]."""
FIX_M, FIX_RAD, WHEELS = 0.01, 0.004, 0.05
"""Standard deviations of a place by a picture, and of what wheels count, as a part of it."""
MOST_OFF = 25.0
"""No pair of pictures speaks more against a lag, in squares of standard deviations: the robot may have been pushed."""
AT_FIRST = 0.3, 0.0, 0.3
"""How fast the robot may be at the first picture: ahead, to the left [m/s], turning [rad/s], one standard deviation."""
KEPT = 0.995
"""So much of what was known is kept with each picture: a lag may change."""
LATE_S, LATE_SIGMAS = 0.15, 3.0
"""Pictures that are older by so much, and surely so, are of no use."""


class DatedPose(NamedTuple):
    """Where the robot was at a time [s]."""

    time_s: float
    pose: Pose2


class PictureLag:
    """Learns how much older pictures are than their stamps say."""

    def __init__(self) -> None:
        self._log = np.zeros(len(LAGS_S))
        self._counted = deque[DatedPose](maxlen=400)
        self._last: DatedPose | None = None
        self._pairs = deque[tuple[DatedPose, DatedPose]]()

    def count(self, time_s: float, counted: Pose2) -> None:
        """Where the wheels counted to be at a time."""
        if not self._counted or time_s > self._counted[-1].time_s:
            self._counted.append(DatedPose(time_s, counted))
        while self._pairs and self._pairs[0][1].time_s - LAGS_S[0] <= time_s:
            self._compare(*self._pairs.popleft())

    def forget_place(self) -> None:
        """The next picture tells nothing of the way since the last one."""
        self._last = None

    def see(self, time_s: float, fix: Pose2) -> None:
        """Where a picture with this stamp says that the robot was."""
        last, self._last = self._last, DatedPose(time_s, fix)
        if last is not None:
            self._pairs.append((last, self._last))

    def _compare(self, last: DatedPose, now: DatedPose) -> None:
        """Hold what two pictures say of the way between them against what was counted, where all of that is known."""
        if last.time_s - LAGS_S[-1] < self._counted[0].time_s:
            return
        seen = last.pose.inverse() @ now.pose
        off = np.array([self._off(last.time_s, now.time_s, seen, float(lag)) for lag in LAGS_S])
        self._log = KEPT * self._log - 0.5 * np.minimum(off, MOST_OFF)

    def _off(self, from_s: float, to_s: float, seen: Pose2, lag_s: float) -> float:
        """How far a motion that was seen is off what was counted so much before, in squares of standard deviations."""
        there = self._at(from_s - lag_s).inverse() @ self._at(to_s - lag_s)
        way, turn = math.hypot(there.x_m, there.y_m), abs(there.heading_rad)
        off_m = math.hypot(seen.x_m - there.x_m, seen.y_m - there.y_m)
        off_rad = wrap_angle(seen.heading_rad - there.heading_rad)
        return (off_m**2 / (2.0 * FIX_M**2 + (WHEELS * way) ** 2)
                + off_rad**2 / (2.0 * FIX_RAD**2 + (WHEELS * turn) ** 2))

    def _at(self, time_s: float) -> Pose2:
        """Where the wheels had counted to be at a time that lies between two counts."""
        number = min(max(1, bisect_right(self._counted, time_s, key=lambda one: one.time_s)), len(self._counted) - 1)
        (began_s, a), (end_s, b) = self._counted[number - 1], self._counted[number]
        part, step = (time_s - began_s) / (end_s - began_s), a.inverse() @ b
        return a @ Pose2(part * step.x_m, part * step.y_m, part * step.heading_rad)

    @property
    def mean_and_sigma_s(self) -> tuple[float, float]:
        """The lag, and its standard deviation [s]."""
        log = self._log - 0.5 * (LAGS_S / BEFORE_SIGMA_S) ** 2
        weights = np.exp(log - log.max())
        weights /= weights.sum()
        mean = float(weights @ LAGS_S)
        return mean, max(LEAST_SIGMA_S, math.sqrt(float(weights @ (LAGS_S - mean) ** 2)))

    @property
    def complaint(self) -> str:
        """What is wrong, in words; "" for nothing."""
        mean, sigma = self.mean_and_sigma_s
        if abs(mean) < max(LATE_S, LATE_SIGMAS * sigma):
            return ""
        late, early = ("pictures", "odometry") if mean > 0.0 else ("odometry", "pictures")
        return f"its {late} are {abs(mean):.2f} s older than their stamps say, by its {early}"

    def widen(self) -> NDArray[np.float64]:
        """(3, 3) covariance, in the robot's frame, of how far it has gone since a picture that may be so late."""
        mean, sigma = self.mean_and_sigma_s
        if len(self._counted) < 2:
            return np.diag(np.array(AT_FIRST) * sigma) ** 2
        (began_s, a), (end_s, b) = self._counted[-2], self._counted[-1]
        step = a.inverse() @ b
        gone = np.array([step.x_m, step.y_m, step.heading_rad]) * math.hypot(mean, sigma) / (end_s - began_s)
        return np.asarray(np.outer(gone, gone))
