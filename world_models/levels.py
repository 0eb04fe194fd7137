"""Location at the levels of the hierarchy (§3.1, §3.4): "in the hallway, at (x, y) +- s", and what that is further up.

Every locale's frame is known in its container only as well as it was surveyed. So a location that is told from further
up, or from across the hierarchy, is at most as precise as it was: going up never invents precision.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from world_models.building.world import World
from world_models.entries.location import Covariance, covariance_tuple
from world_models.frames import Pose2, flattened


@dataclass(frozen=True, slots=True)
class Location:
    """A pose on the floor of a locale and how sure it is.

    Attributes:
        locale: in whose frame it is told.
        pose: locale_from_robot.
        covariance: (3, 3) over (x, y, heading) in that frame.
    """

    locale: str
    pose: Pose2
    covariance: Covariance

    @property
    def sigma_m(self) -> float:
        """Largest standard deviation of the place [m]."""
        return math.sqrt(max(0.0, float(np.linalg.eigvalsh(np.array(self.covariance)[:2, :2])[-1])))

    def __str__(self) -> str:
        return f"in {self.locale}, ({self.pose.x_m:.2f}, {self.pose.y_m:.2f}) m +- {self.sigma_m:.2f} m"


def raised(world: World, location: Location) -> Location:
    """The same location as its container tells it. Raises ValueError in the root, which nothing contains."""
    locale = world.locale(location.locale)
    if locale.parent is None:
        raise ValueError(f"expected a locale that is contained in another, got {location.locale!r}")
    frame = flattened(locale.frame)
    pose = frame @ location.pose
    arm = pose.position - frame.position
    covariance = _turned(location.covariance, frame.heading_rad) + _of_frame(world, location.locale, arm)
    return Location(locale.parent, pose, covariance_tuple(covariance))


def lowered(world: World, location: Location, child: str) -> Location:
    """The same location as a locale in it tells it. Raises ValueError where ``child`` is not directly in its locale."""
    locale = world.locale(child)
    if locale.parent != location.locale:
        raise ValueError(f"expected a locale in {location.locale}, got {child!r}")
    frame = flattened(locale.frame)
    arm = location.pose.position - frame.position
    covariance = np.array(location.covariance) + _of_frame(world, child, arm)
    return Location(child, frame.inverse() @ location.pose,
                    covariance_tuple(_turned(covariance_tuple(covariance), -frame.heading_rad)))


def seen_from(world: World, location: Location, locale: str) -> Location:
    """The same location in the frame of any other locale: up to what contains both, and down again."""
    above = world.common(location.locale, locale)
    while location.locale != above:
        location = raised(world, location)
    path = world.path_of(locale)
    for step in path[path.index(above) + 1 :]:
        location = lowered(world, location, step)
    return location


def _turned(covariance: Covariance, angle_rad: float) -> NDArray[np.float64]:
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(turn @ np.array(covariance) @ turn.T)


def _of_frame(world: World, name: str, arm: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3) what the survey of a frame leaves open of a pose whose place is ``arm`` from its origin."""
    locale = world.locale(name)
    slope = np.array([-arm[1], arm[0], 1.0])
    open_place = np.diag([locale.survey_m**2, locale.survey_m**2, 0.0])
    return open_place + locale.survey_rad**2 * np.outer(slope, slope)
