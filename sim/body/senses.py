"""What the simulated robot feels and hears: a ring of bumper switches, a ring of sonars."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.body.collision import ROBOT_RADIUS_M
from world_models.entries import Contact, Ranges
from world_models.frames import Pose2
from world_models.units import Bounded, bounded


@dataclass(frozen=True, slots=True)
class Bumper(Bounded):
    """A ring of switches round the robot; the first sector has its middle straight ahead.

    Attributes:
        sectors: how many; 0 for a robot without a bumper.
    """

    sectors: int = bounded(12, 0, 360)

    def feel(self, direction_rad: float, when_s: float) -> Contact:
        """What is felt of a touch in this direction from the robot's heading; it may be anywhere in its sector."""
        if not self.sectors:
            return Contact.of_stall(when_s)
        width = math.tau / self.sectors
        middle = math.remainder(round(direction_rad / width) * width, math.tau)
        return Contact("bumper", middle, width / math.sqrt(12.0), when_s)


Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RangeRing(Bounded):
    """Sonars on the robot's rim that face outward, the first one straight ahead.

    Attributes:
        sensors: how many; 0 for a robot without any. The Denning platform had 24.
        half_beam_rad: half of the cone's angle.
        reach_m: from the rim; what is further away sends back no echo.
        sigma_m: standard deviation of a distance.
        specular_rad: an echo at a larger angle of incidence may fail.
        dropout: the part of those that do.
    """

    sensors: int = bounded(0, 0, 24)
    half_beam_rad: float = bounded(math.radians(12.5), 0.001, math.pi / 3.0)
    reach_m: float = bounded(6.0, 0.1, 50.0)
    sigma_m: float = bounded(0.02, 0.0, 1.0)
    specular_rad: float = bounded(math.radians(30.0), 0.0, math.pi / 2.0)
    dropout: float = bounded(0.5, 0.0, 1.0)

    def measure(self, segments_world: Floats, pose: Pose2, rng: np.random.Generator, when_s: float) -> Ranges | None:
        """A reading at a pose among solid segments (n, 2, 2); None without sensors. Two random numbers a sensor."""
        if not self.sensors:
            return None
        axes = [math.remainder(math.tau * number / self.sensors, math.tau) for number in range(self.sensors)]
        distances: list[float | None] = []
        for axis_rad in axes:
            sensor = pose @ Pose2(0.0, 0.0, axis_rad) @ Pose2(ROBOT_RADIUS_M, 0.0, 0.0)
            away_m = self.hear(segments_world, sensor, rng)
            distances.append(None if away_m is None else ROBOT_RADIUS_M + away_m)
        return Ranges(tuple(axes), tuple(distances), self.sigma_m, self.half_beam_rad, ROBOT_RADIUS_M + self.reach_m,
                      when_s)

    def hear(self, segments_world: Floats, sensor: Pose2, rng: np.random.Generator) -> float | None:
        """What one sensor hears, from the sensor [m]; None without an echo. Always takes two random numbers."""
        error, luck = float(rng.standard_normal()), float(rng.random())
        away_m, incidence_rad = find_echo(segments_world, sensor, self.half_beam_rad)
        lost = away_m > self.reach_m or (incidence_rad > self.specular_rad and luck < self.dropout)
        return None if lost else max(0.0, away_m + self.sigma_m * error)


def find_echo(segments_world: Floats, sensor: Pose2, half_beam_rad: float) -> tuple[float, float]:
    """The nearest point of segments (n, 2, 2) in a sensor's cone: (distance [m], angle of incidence [rad]).

    The distance is infinite where nothing is in the cone.
    """
    c, s = math.cos(sensor.heading_rad), math.sin(sensor.heading_rad)
    ends = (segments_world - sensor.position) @ np.array([[c, -s], [s, c]])
    start, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    low, high = np.zeros(len(start)), np.ones(len(start))
    for side in (1.0, -1.0):  # the cone is what two half-planes have in common: clip the segments by both
        normal = np.array([math.sin(half_beam_rad), side * math.cos(half_beam_rad)])
        at_start, slope = start @ normal, along @ normal
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = -at_start / slope
        low = np.where(slope > 0.0, np.maximum(low, crossing), low)
        high = np.where(slope < 0.0, np.minimum(high, crossing), high)
        high = np.where((slope == 0.0) & (at_start < 0.0), -1.0, high)
    length2 = np.maximum(np.einsum("ij,ij->i", along, along), 1e-18)
    nearest = np.minimum(np.maximum(-np.einsum("ij,ij->i", start, along) / length2, low), high)
    points = start + nearest[:, None] * along
    distances = np.where(low <= high, np.hypot(points[:, 0], points[:, 1]), np.inf)
    if not np.isfinite(distances).any():
        return math.inf, 0.0
    best = int(np.argmin(distances))
    across = abs(float(points[best] @ along[best])) / math.sqrt(length2[best]) / max(float(distances[best]), 1e-9)
    return float(distances[best]), math.asin(min(1.0, across))
