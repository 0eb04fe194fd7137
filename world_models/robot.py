"""The robot model (§3): building, camera and wheels, as the methods take them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from world_models.actuator import ActuatorModel
from world_models.building.building import Building
from world_models.camera import NOT_STATED, Camera, CameraDeviation, CameraMount
from world_models.entries.robot_state import CameraState, Footprint, Wheels
from world_models.frames import Pose, Pose2
from world_models.obstruction import Obstruction

_NO_LENS = Camera(1.0, 1.0, 0.0, 0.0, 1, 1)
"""Default of ``lens``: take the camera that the model is made with."""


@dataclass(frozen=True, eq=False)
class RobotModel:
    """A robot in a building, to compute with.

    Attributes:
        world: the building (§3.4): accurate, but incomplete. A knowledge source's is that of the frames on the board.
        camera, mount: the sensor model (§3.2). ``camera`` is a pinhole: all pixels on the board are rectified pixels.
        actuator: the actuator model (§3.2).
        radius_m: radius of the robot's disc.
        lens: the physical camera, with distortion; by default the camera that the model is made with.
        continuous: whether legs are driven without stopping at each increment, corrected by pictures on the move.
        deviation: how well camera and mounting are known.
    """

    world: Building
    camera: Camera
    mount: CameraMount
    actuator: ActuatorModel
    radius_m: float = 0.35
    lens: Camera = _NO_LENS
    continuous: bool = False
    deviation: CameraDeviation = NOT_STATED

    def __post_init__(self) -> None:
        if self.lens is _NO_LENS:
            object.__setattr__(self, "lens", self.camera)
        camera = self.lens.pinhole
        object.__setattr__(self, "camera", camera)
        object.__setattr__(self, "_cameras", {None: camera})  # by obstruction; views are cached by a camera's identity

    def entries(self) -> tuple[CameraState, Wheels, Footprint]:
        """What the robot knows of itself, as it lies on the board."""
        d = self.deviation
        camera = CameraState(self.lens, self.mount, d.tilt_rad, d.height_m, d.forward_m, d.focal,
                             sigma_roll_rad=d.roll_rad, sigma_yaw_rad=d.yaw_rad)
        return camera, Wheels(self.actuator, self.continuous), Footprint(self.radius_m)

    def in_building(self, building: Building) -> RobotModel:
        """The same robot in another building, or in the same one as known differently."""
        return self._with(world=building)

    def on_floor_of(self, locale: str) -> RobotModel:
        """The robot on the floor of a locale.

        Poses are on the plan z = 0 of the world. On a higher floor the camera's mount is higher above that plan.
        """
        height_m = self.world.floor_m(locale)
        if height_m == 0.0:
            return self
        return self._with(mount=replace(self.mount, height_m=self.mount.height_m + height_m))

    def with_obstruction(self, obstruction: Obstruction | None) -> RobotModel:
        """The robot with an obstruction before its camera: it expects to see nothing there."""
        if obstruction == self.camera.obstruction:
            return self
        cameras: dict[Obstruction | None, Camera] = self.__dict__["_cameras"]
        if obstruction not in cameras:
            cameras[obstruction] = replace(self.camera, obstruction=obstruction)
        return self._with(camera=cameras[obstruction])

    def camera_from_world(self, world_from_robot: Pose2) -> Pose:
        """Camera pose for a robot pose on the plan z = 0."""
        return self.mount.camera_from_robot @ world_from_robot.lifted().inverse()

    def _with(self, **changed: Any) -> RobotModel:
        """A copy with other attributes; it shares the cameras."""
        copy = object.__new__(RobotModel)
        copy.__dict__.update(self.__dict__, **changed)
        return copy
