"""Faults of the camera: no picture, or none that is whole and new."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from sim.faults.fault import DeviceFault, Fault, FaultTarget
from world_models.units import Bounds

KNOCK = Bounds(-0.5, 0.5)


@dataclass(frozen=True, slots=True)
class CameraUnplugged(DeviceFault):
    """The camera is gone."""

    kind: ClassVar[str] = "camera_unplugged"
    part: ClassVar[str] = "camera"
    what: ClassVar[str] = "camera unplugged"
    detail: ClassVar[str] = "no such device"


@dataclass(frozen=True, slots=True)
class LateFrames(DeviceFault):
    """Only pictures from before the robot stood still arrive."""

    kind: ClassVar[str] = "late_frames"
    part: ClassVar[str] = "camera"
    what: ClassVar[str] = "frame late"
    detail: ClassVar[str] = "the newest picture was taken before the robot stood"


@dataclass(frozen=True, slots=True)
class DroppedFrames(DeviceFault):
    """Pictures arrive incomplete."""

    kind: ClassVar[str] = "dropped_frames"
    part: ClassVar[str] = "camera"
    what: ClassVar[str] = "frame dropped"
    detail: ClassVar[str] = "no whole picture arrived"


@dataclass(frozen=True, slots=True)
class CameraKnocked(Fault):
    """Something knocks against the camera: its mounting is turned, and stays so.

    Attributes:
        tilt_rad: downward; roll_rad: clockwise as the camera looks; yaw_rad: to the left; each by so much.
    """

    kind: ClassVar[str] = "camera_knocked"
    bounds: ClassVar[Mapping[str, Bounds]] = {"tilt_rad": KNOCK, "roll_rad": KNOCK, "yaw_rad": KNOCK}

    tilt_rad: float = 0.0
    roll_rad: float = 0.0
    yaw_rad: float = 0.0

    def apply(self, body: FaultTarget) -> None:
        body.turn_camera(self.tilt_rad, self.roll_rad, self.yaw_rad)
