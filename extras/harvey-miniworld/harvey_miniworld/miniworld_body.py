"""A body in miniworld's rooms: kinematics with the errors that the actuator model states, a bumper, one camera."""

from __future__ import annotations

import math

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.ops import nearest_points

from harvey.hardware.own_body import OwnBody
from harvey_miniworld.drawn_floor import DrawnFloor
from harvey_miniworld.textured_floor import TexturedFloor
from world_models.actuator import arc
from world_models.entries import Contact, MotionReport, MotorCommand
from world_models.frames import Pose2
from world_models.robot import RobotModel

STEP_M, TURN_RAD_PER_S, LOOK_S = 0.02, 0.8, 0.1
SECTORS = 12
"""Of the bumper."""


class MiniworldBody(OwnBody):
    """A round robot that turns on the spot, moves along arcs and bumps into what stands there.

    Attributes:
        pose: where it truly is, on the plan.
        path_m: how far it has driven.
        contacts: the speed of each touch [m/s].
    """

    def __init__(self, floor: TexturedFloor, robot: RobotModel, start: Pose2, seed: int,
                 kidnap: tuple[float, Pose2] | None = None) -> None:
        """``kidnap``: after so many metres it is put down there."""
        self._drawn = DrawnFloor(floor, robot.lens, robot.mount)
        self._edge, self._radius_m, self._wheels = floor.free.boundary, robot.radius_m, robot.actuator
        self._rng, self._kidnap = np.random.default_rng([seed, 1]), kidnap
        self._curvature = float(self._rng.normal(0.0, self._wheels.curvature_sigma_per_m))
        self._time_s = 0.0
        self._touched: Contact | None = None
        self.pose, self.path_m, self.contacts, self.track = start, 0.0, list[float](), [start]

    @property
    def time_s(self) -> float:
        return self._time_s

    def wait(self, duration_s: float, /) -> float:
        self._time_s += duration_s
        return self._time_s

    def see(self, purpose: str, /) -> NDArray[np.uint8]:
        self._time_s += LOOK_S
        return self._drawn.see(self.pose)

    def execute(self, command: MotorCommand, /) -> MotionReport:
        wheels, rng, began_s = self._wheels, self._rng, self._time_s
        turned = command.turn_rad + rng.normal(0.0, math.sqrt(wheels.turn_variance(command.turn_rad)))
        self._go(Pose2(0.0, 0.0, turned), abs(command.turn_rad) / TURN_RAD_PER_S)
        bend = self._curvature + float(rng.normal(0.0, wheels.bend_sigma_per_m))
        length = command.move_m * wheels.reach * float(1.0 + rng.normal(0.0, wheels.reach_sigma))
        speed = min(wheels.speed_m_per_s, command.speed_m_per_s or wheels.speed_m_per_s)
        steps, done = max(1, math.ceil(length / STEP_M)), 0
        while done < steps and length > 0.0 and self._go(arc(length / steps, bend), length / steps / speed, speed):
            done += 1
        if self._kidnap is not None and self.path_m >= self._kidnap[0]:
            self.pose, self._kidnap = self._kidnap[1], None
            self.track.append(self.pose)
        share = done / steps if length > 0.0 else 1.0
        return MotionReport(command.turn_rad, command.move_m * share, self._time_s - began_s, self._time_s)

    def take_contact(self) -> Contact | None:
        contact, self._touched = self._touched, None
        return contact

    def close(self) -> None:
        """Let the renderer go."""
        self._drawn.close()

    def clearance_m(self, pose: Pose2) -> float:
        """From the robot's rim to what is nearest; negative where they overlap."""
        return float(self._edge.distance(shapely.Point(pose.x_m, pose.y_m))) - self._radius_m

    def _go(self, step: Pose2, takes_s: float, speed_m_per_s: float = 0.0) -> bool:
        """A small step; False where something is touched."""
        there = self.pose @ step
        self._time_s += takes_s
        if step.x_m and self.clearance_m(there) < min(0.0, self.clearance_m(self.pose)):
            self.contacts.append(speed_m_per_s)
            _, near = nearest_points(shapely.Point(there.x_m, there.y_m), self._edge)
            direction = math.atan2(near.y - there.y_m, near.x - there.x_m) - there.heading_rad
            width = math.tau / SECTORS
            middle = math.remainder(round(direction / width) * width, math.tau)
            self._touched = Contact("bumper", middle, width / math.sqrt(12.0), self._time_s)
            return False
        self.path_m += there.distance_to(self.pose)
        self.pose = there
        self.track.append(there)
        return True
