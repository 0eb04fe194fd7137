"""The robot's camera: renderer, lens, what hides the view, motion blur, sensor and JPEG, one picture at a time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sim.body.simulated_building import SimulatedBuilding
from sim.body.wheel_errors import ContinuousMotion
from sim.render.auto_exposure import AutoExposure, vignette
from sim.render.lighting import Lighting
from sim.render.optics import Optics
from sim.render.sensor import Occluder, SensorParameters, compress_jpeg, expose, skip_noise_draws
from sim.truth import Truth
from world_models.camera import Camera, CameraMount
from world_models.entries import CameraPicture
from world_models.frames import Pose

MOTION_BLUR_SAMPLES = 3
"""Sharp pictures of which one that is exposed on the move is the mean."""


class BodyCamera:
    """The camera of a simulated robot.

    Attributes:
        sensor: its parameters.
        frames: how many pictures were taken.
    """

    def __init__(
        self, camera: Camera, mount: CameraMount, sensor: SensorParameters, rng: np.random.Generator,
        lighting: Lighting | None = None,
    ) -> None:
        """``rng`` draws the noise of pictures, and nothing else; with ``lighting`` the camera adapts as that says."""
        self.sensor, self.frames = sensor, 0
        self._optics, self._mount, self._rng = Optics.of(camera), mount, rng
        self._occluders: tuple[Occluder, ...] = ()
        self._recorded: Mapping[int, bytes] = {}
        self._exposure = AutoExposure.of(lighting) if lighting else None
        self._vignette = vignette(camera.height, camera.width, lighting.vignetting) if lighting else None

    def add_occluder(self, occluder: Occluder) -> None:
        """Put something before the camera, until its time is over."""
        self._occluders += (occluder,)

    def turn_mount(self, tilt_rad: float, roll_rad: float, yaw_rad: float) -> None:
        """Turn the mounting: downward, clockwise as the camera looks, to the left."""
        m = self._mount
        self._mount = replace(m, tilt_rad=m.tilt_rad + tilt_rad, roll_rad=m.roll_rad + roll_rad,
                              yaw_rad=m.yaw_rad + yaw_rad)

    def use_recorded(self, pictures: Mapping[int, bytes]) -> None:
        """Deliver these pictures (JPEG, by frame number) instead of rendering them; later noise is the same."""
        self._recorded = pictures

    def take_frame(
        self, building: SimulatedBuilding, truth: Truth, motion: ContinuousMotion, purpose: str
    ) -> CameraPicture:
        """The next frame, numbered from 0, for the purpose of the request."""
        number, self.frames = self.frames, self.frames + 1
        jpeg = self._recorded.get(number)
        if self._exposure is not None and number == 0:
            settled = self._exposure.settle(self._radiance(building, truth, motion), self.sensor.gain)
            self._exposure = replace(settled, time_s=truth.time_s)
        if jpeg is None:
            jpeg = self.take_jpeg(building, truth, motion)
        else:
            skip_noise_draws(self._rng)
        if self._exposure is not None:
            self._exposure = self._exposure.after(jpeg, truth.time_s)
        return CameraPicture(jpeg=jpeg, number=number, sim_time_s=truth.time_s, purpose=purpose)

    def take_jpeg(self, building: SimulatedBuilding, truth: Truth, motion: ContinuousMotion) -> bytes:
        """The JPEG bytes of a picture that is not counted as a frame."""
        radiance = self._radiance(building, truth, motion)
        for occluder in self._occluders:
            if truth.time_s < occluder.until_s:
                radiance = occluder.cover(radiance)
        sensor = self.sensor
        if self._exposure is not None and self._vignette is not None:
            radiance = radiance * (self._exposure.gains * self._vignette)
            noisier = self._exposure.amplification
            sensor = replace(sensor, read_noise=sensor.read_noise * noisier, shot_noise=sensor.shot_noise * noisier)
        image = expose(radiance, sensor, self._rng, lights_on=truth.lights_on)
        return compress_jpeg(image, self.sensor.jpeg_quality)

    def _radiance(self, building: SimulatedBuilding, truth: Truth, motion: ContinuousMotion) -> NDArray[np.float32]:
        """(h, w, 3) light behind the lens; on the move, its mean over the exposure time."""
        here = truth.world_from_robot
        if not (motion.speed_m_per_s > 0.0 and self.sensor.exposure_s > 0.0):
            return self._radiance_from(building, here.lifted(building.floor_m))
        total = self._radiance_from(building, here.lifted(building.floor_m))
        for sample in range(1, MOTION_BLUR_SAMPLES):
            earlier = motion.displacement_after(-self.sensor.exposure_s * sample / (MOTION_BLUR_SAMPLES - 1))
            total = total + self._radiance_from(building, (here @ earlier).lifted(building.floor_m))
        return np.asarray(total / MOTION_BLUR_SAMPLES, np.float32)

    def _radiance_from(self, building: SimulatedBuilding, world_from_robot: Pose) -> NDArray[np.float32]:
        return self._optics.radiance(building.renderer, self._mount.camera_from_robot @ world_from_robot.inverse())
