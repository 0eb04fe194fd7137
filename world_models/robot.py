"""The robot as it knows itself: its world, its eye and its wheels (§3)."""

from __future__ import annotations

from dataclasses import dataclass

from world_models.actuator import ActuatorModel
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose, Pose2
from world_models.world import World

_THE_CAMERA = Camera(1.0, 1.0, 0.0, 0.0, 1, 1)
"""Stands for "the camera that the model is made with"."""


@dataclass(frozen=True, eq=False)
class RobotModel:
    """What every knowledge source may know beside the board.

    Attributes:
        world: the model of the building (§3.4): accurate, but incomplete.
        camera, mount: the sensor model (§3.2). Made with a camera that has lens distortion, ``camera`` is what its
            pictures are like once that is undone: everything that is predicted or found is in these pixels.
        actuator: the actuator model (§3.2).
        radius_m: of the robot's disc.
        lens: the camera as it is, with its distortion; unless given, it is the camera that the model is made with.
    """

    world: World
    camera: Camera
    mount: CameraMount
    actuator: ActuatorModel
    radius_m: float = 0.35
    lens: Camera = _THE_CAMERA

    def __post_init__(self) -> None:
        if self.lens is _THE_CAMERA:
            object.__setattr__(self, "lens", self.camera)
        object.__setattr__(self, "camera", self.lens.pinhole)

    def camera_from_world(self, world_from_robot: Pose2) -> Pose:
        """Where the camera is when the robot is there."""
        return self.mount.camera_from_robot @ world_from_robot.lifted().inverse()
