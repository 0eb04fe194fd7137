"""Walking: a person on a way, from one moment to the next."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from harvey_people.simulated.figure import Figure, outline
from harvey_people.simulated.social_force import TOP_SPEED, drive, repulse, repulse_wall, weigh_by_sight
from sim.body.collision import ROBOT_RADIUS_M, Obstacles
from world_models.frames import Pose2, wrap_angle

Floats = NDArray[np.float64]
WIDTH_M = 0.5
"""Of a person across the shoulders, with some room."""
ARRIVED_M = 0.2
"""So near to a point of the way, it is reached."""
TURNING_RAD_PER_S = 3.0
STANDS_M_PER_S = 0.05
"""A slower person keeps looking the same way."""
PATIENCE_S = 2.0
"""A person who makes no way steps aside after standing before the robot for so long."""
SEES_ROUND_M = 3.0
"""From so far away a person who makes way walks to the side of a robot that is ahead."""
PAST_M = ROBOT_RADIUS_M + 0.45
"""How far beside the robot's axis one passes it."""
ASIDE_M_PER_S = 0.4
"""One whom the robot stops steps aside so fast."""
CLOSE_M, NEAR_M = 0.5, 1.2
"""Nearer to the robot's rim than this, a person on the way counts as close, or near."""
TOUCH_M = 0.01
"""Nearer than this is a touch."""


@dataclass(frozen=True)
class Robot:
    """What people know of the robot: where it is in the world, and how it moves (x, y) [m/s]."""

    pose: Pose2
    velocity: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Pedestrian:
    """A person at a moment.

    Attributes:
        figure: the body.
        way: points in the world frame [m], walked in order from the first.
        floor_m: height of the floor [m].
        wanted_m_per_s: speed.
        starts_s, stays_s, again, makes_way: as in ``[[walkers]]``.
        pose, velocity: now, in the world.
        aim: number of the point that is walked to.
        walked_m: so far.
        waits_until_s: stands until then.
        held_s: how long the robot has been in the way; falls again while it is not.
        news: what this person has just done to the robot, in words.
        nearest_m: least distance from the robot's rim so far.
        close_s, near_s: time on the way within CLOSE_M and NEAR_M of it.
    """

    figure: Figure
    way: tuple[tuple[float, float], ...]
    floor_m: float
    wanted_m_per_s: float
    stays_s: float
    again: bool
    makes_way: bool
    pose: Pose2
    waits_until_s: float
    velocity: tuple[float, float] = (0.0, 0.0)
    aim: int = 1
    walked_m: float = 0.0
    held_s: float = 0.0
    news: str = ""
    nearest_m: float = math.inf
    close_s: float = 0.0
    near_s: float = 0.0

    @staticmethod
    def start(
        figure: Figure, points: Sequence[tuple[float, float]], floor_m: float, wanted_m_per_s: float, *,
        starts_s: float, stays_s: float, again: bool, makes_way: bool,
    ) -> Pedestrian:
        """At the first point, looking to the second."""
        (x, y), (x1, y1) = points[0], points[min(1, len(points) - 1)]
        return Pedestrian(figure, tuple(points), floor_m, wanted_m_per_s, stays_s, again, makes_way,
                          Pose2(x, y, math.atan2(y1 - y, x1 - x)), starts_s)

    @property
    def name(self) -> str:
        return self.figure.name

    def corners(self) -> Floats:
        """As of the figure."""
        return self.figure.corners(self.pose, self.walked_m, math.hypot(*self.velocity))

    def segments_world(self) -> Floats:
        """(n, 2, 2) what is solid."""
        return outline(self.corners(), self.pose.heading_rad)

    def after(self, now_s: float, duration_s: float, others: Sequence[Pedestrian], robot: Robot | None,
              obstacles: Obstacles) -> Pedestrian:
        """A short while later; ``robot`` is None on another floor."""
        me = self._take_aim(now_s)
        towards = me._towards(now_s, robot if me.makes_way or me.held_s > PATIENCE_S else None, obstacles)
        velocity = me._change_velocity(towards, duration_s, others, robot, obstacles)
        speed = math.hypot(*velocity)
        x, y = me.pose.x_m + velocity[0] * duration_s, me.pose.y_m + velocity[1] * duration_s
        turn = wrap_angle(math.atan2(velocity[1], velocity[0]) - me.pose.heading_rad) if speed > STANDS_M_PER_S else 0.0
        most = TURNING_RAD_PER_S * duration_s
        there = Pose2(x, y, me.pose.heading_rad + min(most, max(-most, turn)))
        moved = replace(me, pose=there, velocity=velocity,
                        walked_m=me.walked_m + speed * duration_s, held_s=max(0.0, me.held_s - duration_s), news="")
        moved = moved._stop_at(me, duration_s, robot, obstacles)
        if robot is None:
            return moved
        away_m = moved.pose.distance_to(robot.pose) - ROBOT_RADIUS_M
        counts_s = duration_s * me.is_under_way(now_s)
        return replace(moved, nearest_m=min(me.nearest_m, away_m), close_s=me.close_s + counts_s * (away_m < CLOSE_M),
                       near_s=me.near_s + counts_s * (away_m < NEAR_M))

    def is_under_way(self, now_s: float) -> bool:
        """Whether this one walks, or would, but for what is in the way."""
        return self.aim < len(self.way) and now_s >= self.waits_until_s

    def measure_way_m(self) -> float:
        """How far on the way this one has come; of a way that is walked again, since its last end."""
        left = [(self.pose.x_m, self.pose.y_m), *self.way[self.aim:]]
        whole_m = math.fsum(math.dist(a, b) for a, b in pairwise(self.way))
        return whole_m - math.fsum(math.dist(a, b) for a, b in pairwise(left))

    def _take_aim(self, now_s: float) -> Pedestrian:
        """The next point where this one is reached; at an end it waits, and turns back if it walks again."""
        if self.aim >= len(self.way) or math.dist((self.pose.x_m, self.pose.y_m), self.way[self.aim]) > ARRIVED_M:
            return self
        if self.aim + 1 < len(self.way) or not self.again:
            return replace(self, aim=self.aim + 1)
        return replace(self, way=self.way[::-1], aim=1, waits_until_s=now_s + self.stays_s)

    def _towards(self, now_s: float, robot: Robot | None, obstacles: Obstacles) -> Floats:
        """(2,) unit vector to where is walked, past the robot where it is in the way; zero for one who stands."""
        if not self.is_under_way(now_s):
            return np.zeros(2)
        ahead = _unit(np.array(self.way[self.aim]) - self.pose.position)
        if robot is None:
            return ahead
        aside, to_robot = np.array([-ahead[1], ahead[0]]), robot.pose.position - self.pose.position
        if not 0.0 < to_robot @ ahead < SEES_ROUND_M or abs(to_robot @ aside) > PAST_M:
            return ahead
        sides = [robot.pose.position + side * PAST_M * aside for side in (-1.0, 1.0)]  # right where both are free
        rooms = [min(PAST_M, obstacles.clearance_m(Pose2(float(x), float(y), 0.0), 0.0)) for x, y in sides]
        return _unit(sides[int(rooms[1] > rooms[0])] - self.pose.position)

    def _change_velocity(self, towards: Floats, duration_s: float, others: Sequence[Pedestrian], robot: Robot | None,
                         obstacles: Obstacles) -> tuple[float, float]:
        """The velocity after a short while (x, y) [m/s]."""
        if not towards.any():
            return (0.0, 0.0)
        force = drive(np.array(self.velocity), self.wanted_m_per_s, towards)
        for other in others:
            if other.floor_m == self.floor_m:
                push = repulse(self.pose.position - other.pose.position, np.array(other.velocity))
                force = force + weigh_by_sight(push, towards)
        if robot is not None and (self.makes_way or self.held_s > PATIENCE_S):
            away = self.pose.position - robot.pose.position
            rim = away * max(0.05, 1.0 - ROBOT_RADIUS_M / max(1e-9, float(np.hypot(*away))))
            push = repulse_wall(rim)  # to people its rim is a border, which pushes aside: the way leads past it
            force = force + push - min(0.0, float(push @ towards)) * towards
        force = force + repulse_wall(nearest_wall(obstacles, self.pose))
        velocity = np.array(self.velocity) + duration_s * force
        speed = float(np.hypot(*velocity))
        velocity = velocity * min(1.0, TOP_SPEED * self.wanted_m_per_s / max(1e-9, speed))
        return float(velocity[0]), float(velocity[1])

    def _stop_at(self, before: Pedestrian, duration_s: float, robot: Robot | None, obstacles: Obstacles) -> Pedestrian:
        """Stands where a step would lead into a wall or into the robot; the latter is news when it begins."""
        still = replace(before, velocity=(0.0, 0.0), news="")
        room_m = obstacles.clearance_m(self.pose, WIDTH_M / 2.0)
        if room_m < 0.0 and room_m < obstacles.clearance_m(before.pose, WIDTH_M / 2.0):
            return still
        if robot is None or math.dist((self.pose.x_m, self.pose.y_m), (robot.pose.x_m, robot.pose.y_m)) > 2.0:
            return self
        gap_m, was_m = self._gap_m(robot), before._gap_m(robot)
        if gap_m > TOUCH_M or gap_m > was_m:
            return self
        speed = math.hypot(*self.velocity)
        told = f"{self.name} walked into it at {speed:.2f} m/s" if before.held_s == 0.0 and speed > 0.0 else ""
        aside = still._step_aside(duration_s, robot, obstacles)
        free = (there for there in (aside, still) if there._gap_m(robot) >= min(was_m, TOUCH_M))
        return replace(next(free, before), held_s=before.held_s + duration_s, news=told)

    def _gap_m(self, robot: Robot) -> float:
        """Between this person and the robot [m]."""
        return Obstacles(self.segments_world()).clearance_m(robot.pose)

    def _step_aside(self, duration_s: float, robot: Robot, obstacles: Obstacles) -> Pedestrian:
        """Past the robot, legs together, on the side on which the way goes on; the same where a wall is there."""
        away = self.pose.position - robot.pose.position
        away = away / max(1e-9, float(np.hypot(*away)))
        aside = np.array([-away[1], away[0]])
        ahead = np.array(self.way[min(self.aim, len(self.way) - 1)]) - self.pose.position
        step = ASIDE_M_PER_S * (aside if aside @ ahead >= 0.0 else -aside) + 0.5 * ASIDE_M_PER_S * away
        there = Pose2(self.pose.x_m + duration_s * step[0], self.pose.y_m + duration_s * step[1], self.pose.heading_rad)
        if obstacles.clearance_m(there, WIDTH_M / 2.0) < min(0.0, obstacles.clearance_m(self.pose, WIDTH_M / 2.0)):
            return self
        return replace(self, pose=there)


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / max(1e-9, float(np.hypot(*vector))))


def nearest_wall(obstacles: Obstacles, pose: Pose2) -> Floats:
    """(2,) from the nearest point of what is solid to a person [m]."""
    away_m = obstacles.clearance_m(pose, 0.0)
    if not math.isfinite(away_m):
        return np.array([1e3, 0.0])
    direction = pose.heading_rad + obstacles.nearest_direction_rad(pose)
    return -away_m * np.array([math.cos(direction), math.sin(direction)])
