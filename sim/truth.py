"""The robot's true state, and the score of a run. Only simulator, recorder and referee may read them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from world_models.frames import Pose2, wrap_angle


@dataclass(frozen=True, slots=True)
class Truth:
    """The true state at one moment.

    Attributes:
        world_from_robot: pose.
        time_s: simulated time since the run began [s].
        path_m: length of the path driven so far [m]; displacements by faults do not count.
        collisions: contacts so far.
        contact_m_per_s: how fast it moved when it touched something last.
        lights_on: whether the building is lit.
        locale: the name of the locale that it is in, "" outside all.
    """

    world_from_robot: Pose2
    time_s: float = 0.0
    path_m: float = 0.0
    collisions: int = 0
    contact_m_per_s: float = 0.0
    lights_on: bool = True
    locale: str = ""


@dataclass(frozen=True, slots=True)
class Score:
    """The true errors at the end of a run.

    Attributes:
        position_error_m: distance from the goal.
        error_x_m, error_y_m: robot minus goal, in the world frame.
        heading_error_rad: robot minus arrival heading; None where any heading will do.
        max_cross_track_m: largest distance from the straight line between start and goal.
        path_m, collisions, time_s: as in :class:`Truth`.
    """

    position_error_m: float
    error_x_m: float
    error_y_m: float
    heading_error_rad: float | None
    max_cross_track_m: float
    path_m: float
    collisions: int
    time_s: float


def score(track: Sequence[Truth], start_world: Pose2, goal_world: Pose2, *, heading_matters: bool = False) -> Score:
    """Score the true track of a run against the intended start and the goal, both in the world frame.

    Raises:
        ValueError: the track is empty.
    """
    if not track:
        raise ValueError("expected a track of at least one moment, got none")
    last = track[-1]
    x = last.world_from_robot.x_m - goal_world.x_m
    y = last.world_from_robot.y_m - goal_world.y_m
    heading = wrap_angle(last.world_from_robot.heading_rad - goal_world.heading_rad) if heading_matters else None
    return Score(
        position_error_m=math.hypot(x, y),
        error_x_m=x,
        error_y_m=y,
        heading_error_rad=heading,
        max_cross_track_m=max(abs(cross_track_m(t.world_from_robot, start_world, goal_world)) for t in track),
        path_m=last.path_m,
        collisions=last.collisions,
        time_s=last.time_s,
    )


def cross_track_m(pose: Pose2, start: Pose2, goal: Pose2) -> float:
    """Signed distance of a pose from the line from start to goal [m], positive to its left."""
    dx, dy = goal.x_m - start.x_m, goal.y_m - start.y_m
    length = math.hypot(dx, dy)
    if length < 1e-9:
        return pose.distance_to(start)
    return (dx * (pose.y_m - start.y_m) - dy * (pose.x_m - start.x_m)) / length
