"""What the robot knows of itself: camera and mounting, wheels, footprint (§3.2); what is learnt of them revises it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from blackboard import inference, observation
from world_models import words
from world_models.actuator import MAX_INNOVATION_SIGMAS, ActuatorModel
from world_models.camera import CAMERA_UNKNOWNS, Camera, CameraMount, move_camera, subtract_cameras
from world_models.frames import wrap_angle


@observation(traced=True)
@dataclass(frozen=True)
class CameraState:
    """The sensor model (§3.2): the camera and how it is mounted, each with its standard deviation.

    Attributes:
        lens: the physical camera, with its distortion.
        mount: where it is on the robot.
        sigma_tilt_rad, sigma_height_m, sigma_forward_m, sigma_focal: standard deviations of the mounting and, as a part
            of it, of the focal length; 0 where nobody has stated any. sigma_roll_rad, sigma_yaw_rad: the same.
        covariance: (7, 7) over :data:`~world_models.camera.CAMERA_UNKNOWNS`, once it is learnt from milestones, or ().
        counted: the poses (x [m], y [m], heading [rad], world) of the pictures by which it was learnt, the newest last.
        nominal_lens, nominal_mount: both as they were set up, once they were learnt to be different.
    """

    lens: Camera
    mount: CameraMount
    sigma_tilt_rad: float = 0.0
    sigma_height_m: float = 0.0
    sigma_forward_m: float = 0.0
    sigma_focal: float = 0.0
    sigma_roll_rad: float = 0.0
    sigma_yaw_rad: float = 0.0
    covariance: tuple[tuple[float, ...], ...] = ()
    counted: tuple[tuple[float, ...], ...] = ()
    nominal_lens: Camera | None = None
    nominal_mount: CameraMount | None = None

    def moved(self, step: Sequence[float]) -> CameraState:
        """The state with its camera after a step (7,) of :data:`~world_models.camera.CAMERA_UNKNOWNS`."""
        lens, mount = move_camera(self.lens, self.mount, step)
        return replace(self, lens=lens, mount=mount, nominal_lens=self.nominal_lens or self.lens,
                       nominal_mount=self.nominal_mount or self.mount)

    def as_nominal(self) -> CameraState:
        """The state before anything was learnt."""
        return replace(self, lens=self.nominal_lens or self.lens, mount=self.nominal_mount or self.mount, covariance=(),
                       counted=(), nominal_lens=None, nominal_mount=None)

    @cached_property
    def pinhole(self) -> Camera:
        """The camera of rectified pictures; the same object each time, as views are cached by it."""
        return self.lens.pinhole

    def sentence(self) -> str:
        lens, mount = self.lens, self.mount
        turned = "".join(f", {name} {words.degrees(angle)}" for name, angle in (
            ("rolled", mount.roll_rad), ("turned to the left", mount.yaw_rad)) if angle)
        return (f"camera of {lens.width} x {lens.height} px, focal length {lens.fx:.1f} px, mounted"
                f" {words.metres(mount.height_m)} above the floor, looking {words.degrees(mount.tilt_rad)}"
                f" down{turned}; {words.metres(mount.forward_m)} ahead of the axis; {self._certainty()}")

    def _certainty(self) -> str:
        if self.covariance:
            deviations = (math.sqrt(row[i]) for i, row in enumerate(self.covariance))
            sigma = dict(zip(CAMERA_UNKNOWNS, deviations, strict=True))
            return (f"tilt +-{math.degrees(sigma['tilt_rad']):.2f}, roll +-{math.degrees(sigma['roll_rad']):.2f}, yaw"
                    f" +-{math.degrees(sigma['yaw_rad']):.2f} degrees, +-{1000 * sigma['height_m']:.0f} mm up, focal"
                    f" length +-{sigma['focal']:.2%}, by {words.count(len(self.counted), 'picture')}")
        if not any((self.sigma_tilt_rad, self.sigma_height_m, self.sigma_forward_m, self.sigma_focal)):
            return "nobody has stated how exactly"
        return (f"+-{math.degrees(self.sigma_tilt_rad):.2f} degrees, +-{1000 * self.sigma_height_m:.0f} mm up,"
                f" +-{1000 * self.sigma_forward_m:.0f} mm ahead, focal length +-{self.sigma_focal:.2%}")


@observation(traced=True)
@dataclass(frozen=True, slots=True)
class Wheels:
    """The actuator model (§3.2), with the standard deviations of what the wheels do; :class:`Drift` is learnt of them.

    Attributes:
        actuator: motion model of the primitives TURN and MOVE.
        continuous: whether legs are driven without stopping at each increment, corrected by pictures on the move.
    """

    actuator: ActuatorModel
    continuous: bool = False

    def sentence(self) -> str:
        a = self.actuator
        return (f"wheels that drive {a.reach:.3f} +- {a.reach_sigma:.3f} of the way commanded and drift by"
                f" +-{math.degrees(a.curvature_sigma_per_m):.2f} degrees a metre;"
                f" {'corrected on the move' if self.continuous else 'corrected after each increment'}")


@observation(traced=True)
@dataclass(frozen=True, slots=True)
class Footprint:
    """The robot's extent on the floor: a disc round its axis.

    Attributes:
        radius_m, sigma_m: of the disc, and its standard deviation.
    """

    radius_m: float
    sigma_m: float = 0.0

    def sentence(self) -> str:
        return f"the robot's footprint is a disc with a radius of {words.metres(self.radius_m)}"


@inference()
@dataclass(frozen=True, slots=True)
class Drift:
    """Online estimate of the wheels' curvature bias: a one-dimensional Kalman filter.

    One measurement is the change of heading over a stretch of way, from :meth:`restart` to :meth:`update`.

    Attributes:
        curvature_per_m: of a MOVE; positive drifts to the left.
        sigma_per_m: its standard deviation.
        heading_rad: believed at the start of the stretch [rad, world].
        turned_rad, turned_variance: turns commanded since, and the variance of their execution.
        gone_m: metres driven since.
    """

    curvature_per_m: float
    sigma_per_m: float
    heading_rad: float
    turned_rad: float = 0.0
    turned_variance: float = 0.0
    gone_m: float = 0.0

    @staticmethod
    def unknown(actuator: ActuatorModel, heading_rad: float) -> Drift:
        """The prior: zero curvature, the actuator model's standard deviation."""
        return Drift(0.0, actuator.curvature_sigma_per_m, heading_rad)

    def after_motion(
        self, actuator: ActuatorModel, turn_rad: float, move_m: float, *, on_the_spot: bool = True
    ) -> Drift:
        """The stretch extended by a reported TURN and MOVE; ``on_the_spot=False`` for a turn steered along an arc."""
        variance = actuator.turn_variance(turn_rad) if on_the_spot else (actuator.turn_sigma * turn_rad) ** 2
        return replace(
            self, turned_rad=self.turned_rad + turn_rad, gone_m=self.gone_m + actuator.reach * move_m,
            turned_variance=self.turned_variance + variance,
        )

    def restart(self, heading_rad: float) -> Drift:
        """The same estimate; a new stretch starts here."""
        return Drift(self.curvature_per_m, self.sigma_per_m, heading_rad)

    def update(self, actuator: ActuatorModel, heading_rad: float, sigma_rad: float) -> Drift:
        """Kalman update with the heading measured at the end of a stretch; a new stretch starts here.

        An innovation above MAX_INNOVATION_SIGMAS, as after a push, leaves the estimate as it was.

        Args:
            heading_rad: measured [rad, world].
            sigma_rad: standard deviation of the measured change of heading.
        """
        if self.gone_m <= 0.0:
            return self.restart(heading_rad)
        bent = wrap_angle(heading_rad - self.heading_rad - self.turned_rad) / self.gone_m
        noise = (self.turned_variance + sigma_rad**2) / self.gone_m**2 + actuator.bend_sigma_per_m**2
        if (bent - self.curvature_per_m) ** 2 > MAX_INNOVATION_SIGMAS**2 * (self.sigma_per_m**2 + noise):
            return self.restart(heading_rad)
        gain = self.sigma_per_m**2 / (self.sigma_per_m**2 + noise)
        curvature = self.curvature_per_m + gain * (bent - self.curvature_per_m)
        return Drift(curvature, math.sqrt(1.0 - gain) * self.sigma_per_m, heading_rad)

    def sentence(self) -> str:
        spread = f"+-{math.degrees(self.sigma_per_m):.2f}"
        return (f"the wheels drift by {words.bend(self.curvature_per_m)} ({spread}); by what was seen until"
                f" {words.metres(self.gone_m)} ago")


MIN_SIGMAS = 3.0
"""What is off by less than so many standard deviations is as believed."""
WORTH_TELLING = (math.radians(0.1), math.radians(0.1), math.radians(0.2), 0.005, 0.005, 2.0, 2.0)
"""Nor is less than this mentioned; in the order of ``CAMERA_UNKNOWNS``."""
WORDS = (("looks", "degrees lower", "degrees higher"), ("is rolled by", "degrees clockwise", "degrees anticlockwise"),
         ("looks", "degrees further left", "degrees further right"), ("is", "mm higher", "mm lower"),
         ("has a focal length", "% longer", "% shorter"),
         ("has its principal point", "px further right", "px further left"),
         ("has its principal point", "px lower", "px higher"))
"""How each is put in words: a verb, and what a positive and a negative difference is."""
SCALES = (*[math.degrees(1.0)] * 3, 1000.0, 100.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True)
class CameraLesson:
    """One way in which the camera differs from the nominal one.

    Attributes:
        what: which of :data:`~world_models.camera.CAMERA_UNKNOWNS`.
        off: by how much it is more than nominal [rad, m, part of the focal length, px].
        sigma: standard deviation of that.
    """

    what: str
    off: float
    sigma: float

    def text(self) -> str:
        """``camera looks 1.10 degrees lower than told (+-0.03)``."""
        i = CAMERA_UNKNOWNS.index(self.what)
        verb, more, less = WORDS[i]
        unit = more if self.off > 0.0 else less
        return f"camera {verb} {abs(self.off) * SCALES[i]:.2f} {unit} than told (+-{self.sigma * SCALES[i]:.2f})"


def find_camera_lessons(nominal: CameraState, learnt: CameraState) -> tuple[CameraLesson, ...]:
    """What surely differs from the nominal camera, by enough to be worth telling; empty where nothing was learnt."""
    if not learnt.covariance:
        return ()
    off = subtract_cameras(learnt.lens, learnt.mount, nominal.lens, nominal.mount)
    sigmas = [math.sqrt(row[i]) for i, row in enumerate(learnt.covariance)]
    return tuple(
        CameraLesson(name, by, sigma)
        for name, by, sigma, least in zip(CAMERA_UNKNOWNS, off, sigmas, WORTH_TELLING, strict=True)
        if abs(by) > max(least, MIN_SIGMAS * sigma))
