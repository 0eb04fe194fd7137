"""The robot model (§3): its world, camera and wheels, as knowledge sources know them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from world_models.actuator import ActuatorModel
from world_models.building.world import World
from world_models.camera import Camera, CameraMount
from world_models.entries.obstruction import Obstruction
from world_models.frames import Pose, Pose2

_NO_LENS = Camera(1.0, 1.0, 0.0, 0.0, 1, 1)
"""Default of ``lens``: take the camera that the model is made with."""


@dataclass(frozen=True, eq=False)
class RobotModel:
    """What a knowledge source knows beside the board.

    Attributes:
        world: the model of the building (§3.4): accurate, but incomplete.
        camera, mount: the sensor model (§3.2). ``camera`` is a pinhole: all pixels on the board are rectified pixels.
        actuator: the actuator model (§3.2).
        radius_m: radius of the robot's disc.
        lens: the physical camera, with distortion; by default the camera that the model is made with.
        continuous: whether legs are driven without stopping at each increment, corrected by pictures on the move.
    """

    world: World
    camera: Camera
    mount: CameraMount
    actuator: ActuatorModel
    radius_m: float = 0.35
    lens: Camera = _NO_LENS
    continuous: bool = False

    def __post_init__(self) -> None:
        if self.lens is _NO_LENS:
            object.__setattr__(self, "lens", self.camera)
        object.__setattr__(self, "camera", self.lens.pinhole)

    def on_floor_of(self, locale: str) -> RobotModel:
        """The robot on the floor of a locale.

        Poses are on the plan z = 0 of the world. On a higher floor the camera's mount is higher above that plan.
        """
        height_m = self.world.floor_m(locale)
        if height_m == 0.0:
            return self
        if height_m not in self._raised:
            raised = replace(self, mount=replace(self.mount, height_m=self.mount.height_m + height_m))
            object.__setattr__(raised, "camera", self.camera)  # the same object: caches of views compare it by identity
            self._raised[height_m] = raised
        return self._raised[height_m]

    def with_obstruction(self, obstruction: Obstruction | None) -> RobotModel:
        """The robot with an obstruction before its camera: it expects to see nothing there."""
        if obstruction == self.camera.obstruction:
            return self
        if obstruction not in self._obstructed:
            obstructed = replace(self)
            object.__setattr__(obstructed, "camera", replace(self.camera, obstruction=obstruction))
            self._obstructed[obstruction] = obstructed
        return self._obstructed[obstruction]

    @cached_property
    def _obstructed(self) -> dict[Obstruction | None, RobotModel]:
        """The same robot with other obstructions."""
        return {}

    @cached_property
    def _raised(self) -> dict[float, RobotModel]:
        """The same robot on other floors, by their height [m]."""
        return {}

    def camera_from_world(self, world_from_robot: Pose2) -> Pose:
        """Camera pose for a robot pose on the plan z = 0."""
        return self.mount.camera_from_robot @ world_from_robot.lifted().inverse()
