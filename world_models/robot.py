"""The robot as it knows itself: its world, its eye and its wheels (§3)."""

from __future__ import annotations

from dataclasses import dataclass

from world_models.actuator import ActuatorModel
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose, Pose2
from world_models.world import World


@dataclass(frozen=True, eq=False)
class RobotModel:
    """What every knowledge source may know beside the board.

    Attributes:
        world: the model of the building (§3.4): accurate, but incomplete.
        camera, mount: the sensor model (§3.2).
        actuator: the actuator model (§3.2).
        radius_m: of the robot's disc.
    """

    world: World
    camera: Camera
    mount: CameraMount
    actuator: ActuatorModel
    radius_m: float = 0.35

    def camera_from_world(self, world_from_robot: Pose2) -> Pose:
        """Where the camera is when the robot is there."""
        return self.mount.camera_from_robot @ world_from_robot.lifted().inverse()
