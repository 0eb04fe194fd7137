"""The robot as it knows itself: its world, its eye and its wheels (§3)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from world_models.actuator import ActuatorModel
from world_models.building.world import World
from world_models.camera import Camera, CameraMount
from world_models.entries.obstruction import Obstruction
from world_models.frames import Pose, Pose2

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
        continuous: whether legs are driven without stopping at each increment, corrected by pictures on the move.
        lens: the camera as it is, with its distortion; unless given, it is the camera that the model is made with.
    """

    world: World
    camera: Camera
    mount: CameraMount
    actuator: ActuatorModel
    radius_m: float = 0.35
    lens: Camera = _THE_CAMERA
    continuous: bool = False

    def __post_init__(self) -> None:
        if self.lens is _THE_CAMERA:
            object.__setattr__(self, "lens", self.camera)
        object.__setattr__(self, "camera", self.lens.pinhole)

    def on_floor_of(self, locale: str) -> RobotModel:
        """The robot on the floor of a locale. Poses are told on the plan of the world: one floor up, its camera is as
        much higher above that plan, as if it were mounted there."""
        height_m = self.world.floor_m(locale)
        if height_m == 0.0:
            return self
        if height_m not in self._raised:
            raised = replace(self, mount=replace(self.mount, height_m=self.mount.height_m + height_m))
            object.__setattr__(raised, "camera", self.camera)  # the same camera, by which views are remembered
            self._raised[height_m] = raised
        return self._raised[height_m]

    def with_obstruction(self, obstruction: Obstruction | None) -> RobotModel:
        """The robot, who knows that something stands before its camera: it expects to see nothing there."""
        if obstruction == self.camera.obstruction:
            return self
        if obstruction not in self._behind:
            behind = replace(self)
            object.__setattr__(behind, "camera", replace(self.camera, obstruction=obstruction))
            self._behind[obstruction] = behind
        return self._behind[obstruction]

    @cached_property
    def _behind(self) -> dict[Obstruction | None, RobotModel]:
        """The same robot behind what has stood before its camera."""
        return {}

    @cached_property
    def _raised(self) -> dict[float, RobotModel]:
        """The same robot on other floors, by their height."""
        return {}

    def camera_from_world(self, world_from_robot: Pose2) -> Pose:
        """Where the camera is when the robot is there."""
        return self.mount.camera_from_robot @ world_from_robot.lifted().inverse()
