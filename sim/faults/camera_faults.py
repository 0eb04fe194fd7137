"""Faults of the camera: no picture, or none that is whole and new."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from sim.faults.fault import DeviceFault


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
