"""The faults that come with the simulator: lights off, a view hidden, the robot moved, base or camera failing."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from sim.faults.fault import DURATION, DeviceFault, Fault, FaultTarget, PassingFault
from sim.render.sensor import Occluder
from world_models.entries import Place
from world_models.frames import Pose2
from world_models.units import Bounds


@dataclass(frozen=True, slots=True)
class LightsOff(PassingFault):
    """The building's lights go off."""

    kind: ClassVar[str] = "lights_off"

    @property
    def words(self) -> str:
        return f"the lights go off for {self.duration_s:g} s"

    def apply(self, body: FaultTarget) -> None:
        body.turn_lights_off(self.duration_s)


@dataclass(frozen=True, slots=True)
class Occlusion(PassingFault):
    """A rectangle of the picture is hidden. Where it is, and how dark, is drawn at random.

    Attributes:
        part: of the picture's area, 0..1.
    """

    kind: ClassVar[str] = "occluded"
    bounds: ClassVar[Mapping[str, Bounds]] = {"duration_s": DURATION, "part": Bounds(0.0, 0.99, above=True)}

    part: float = 0.2

    @property
    def words(self) -> str:
        return f"something covers {self.part:.0%} of the camera's picture for {self.duration_s:g} s"

    def apply(self, body: FaultTarget) -> None:
        body.add_occluder(Occluder.draw(self.part, body.truth.time_s + self.duration_s, body.fault_rng))


MAX_DISPLACEMENT_M = 5.0
"""Largest displacement along each axis; further only to a place that is named."""
MAX_SHORTFALL_M = 0.005
"""A displacement that falls short by more than this, for want of room, is reported."""
MAX_DRAWS = 50
"""Random directions that are tried for a free place."""
DISPLACEMENT_BOUNDS: Mapping[str, Bounds] = {
    "forward_m": Bounds(-MAX_DISPLACEMENT_M, MAX_DISPLACEMENT_M),
    "left_m": Bounds(-MAX_DISPLACEMENT_M, MAX_DISPLACEMENT_M),
    "turn_rad": Bounds(-2.0 * math.pi, 2.0 * math.pi),
    "distance_m": Bounds(0.0, MAX_DISPLACEMENT_M),
}


@dataclass(frozen=True, slots=True)
class Displacement(Fault):
    """The robot is moved without its wheels turning, to a free place in the same locale.

    Attributes:
        forward_m, left_m, turn_rad: displacement in the robot's frame.
        distance_m: besides that, this far in a random direction; if it is above 0, the turn's sign is random too.
    """

    bounds: ClassVar[Mapping[str, Bounds]] = DISPLACEMENT_BOUNDS

    forward_m: float = 0.0
    left_m: float = 0.0
    turn_rad: float = 0.0
    distance_m: float = 0.0

    @property
    def min_distance_m(self) -> float:
        """The least distance that it asks for [m]; less is for want of room."""
        return abs(self.distance_m - math.hypot(self.forward_m, self.left_m))

    def draw(self, rng: np.random.Generator) -> Pose2:
        """A displacement in the robot's frame. Always takes two numbers from ``rng``."""
        direction, coin = float(rng.uniform(-math.pi, math.pi)), float(rng.random())
        sign = -1.0 if self.distance_m > 0 and coin < 0.5 else 1.0
        return Pose2(
            self.forward_m + self.distance_m * math.cos(direction),
            self.left_m + self.distance_m * math.sin(direction),
            sign * self.turn_rad,
        )

    def find_free_pose(
        self, world_from_robot: Pose2, rng: np.random.Generator, is_free: Callable[[Pose2], bool]
    ) -> Pose2:
        """A free pose (world frame) to which the robot at ``world_from_robot`` is moved.

        A random displacement is drawn again until its end is free, up to 50 times. After that, and for one that is not
        random, the first free pose on the way back to the start is taken, in steps of 5 %. Where none is free the
        robot only turns.
        """
        move = self.draw(rng)
        for _ in range(MAX_DRAWS if self.distance_m > 0 else 0):
            if is_free(world_from_robot @ move):
                return world_from_robot @ move
            move = self.draw(rng)
        for part in np.linspace(1.0, 0.0, 21):
            there = world_from_robot @ Pose2(float(part) * move.x_m, float(part) * move.y_m, move.heading_rad)
            if is_free(there):
                return there
        return world_from_robot @ Pose2(0.0, 0.0, move.heading_rad)

    def apply(self, body: FaultTarget) -> None:
        before = body.truth.world_from_robot
        there = self.find_free_pose(before, body.fault_rng, body.is_free)
        moved_m = there.distance_to(before)
        if self.min_distance_m - moved_m > MAX_SHORTFALL_M:
            body.report_missed(f"{self.kind}: {moved_m:.2f} m of {self.min_distance_m:.2f} m, for want of room")
        body.put_robot(there)


@dataclass(frozen=True, slots=True)
class Bump(Displacement):
    """Somebody bumps into the robot."""

    kind: ClassVar[str] = "bump"

    @property
    def words(self) -> str:
        return "somebody bumps into the robot"


@dataclass(frozen=True, slots=True)
class Kidnap(Displacement):
    """Somebody kidnaps the robot: by a displacement, or to a place in any locale.

    Attributes:
        to_locale: the place's locale; "" for a displacement instead.
        to_x_m, to_y_m, to_heading_rad: the pose there, in the locale's frame.
    """

    kind: ClassVar[str] = "kidnap"
    bounds: ClassVar[Mapping[str, Bounds]] = {
        **DISPLACEMENT_BOUNDS,
        "to_x_m": Bounds(-1e5, 1e5),
        "to_y_m": Bounds(-1e5, 1e5),
        "to_heading_rad": Bounds(-2.0 * math.pi, 2.0 * math.pi),
    }

    to_locale: str = ""
    to_x_m: float = 0.0
    to_y_m: float = 0.0
    to_heading_rad: float = 0.0

    def __post_init__(self) -> None:
        Displacement.__post_init__(self)
        unused = DISPLACEMENT_BOUNDS if self.to_locale else ("to_x_m", "to_y_m", "to_heading_rad")
        given = [key for key in unused if getattr(self, key) != 0.0]
        if given:
            expected = "no displacement beside to_locale" if self.to_locale else "to_locale beside the place in it"
            raise ValueError(f"expected {expected}, got {', '.join(given)}")

    @property
    def words(self) -> str:
        return "somebody kidnaps the robot"

    @property
    def destination(self) -> Place | None:
        return Place(self.to_locale, self.to_x_m, self.to_y_m, self.to_heading_rad) if self.to_locale else None

    def apply(self, body: FaultTarget) -> None:
        if self.destination is None:
            Displacement.apply(self, body)
        else:
            body.put_robot(body.world_from_place(self.destination))


WATCHDOG_S = 0.5
"""A base that receives nothing any more stops by itself after this time [s]."""


@dataclass(frozen=True, slots=True)
class LinkLost(DeviceFault):
    """Nothing comes through the line, in either direction. The base's watchdog stops it."""

    kind: ClassVar[str] = "link_lost"
    part: ClassVar[str] = "base"
    what: ClassVar[str] = "link lost"
    detail: ClassVar[str] = "no answer on the line"
    stops_motion_after_s: ClassVar[float | None] = WATCHDOG_S
    odometry_arrives: ClassVar[bool] = False


@dataclass(frozen=True, slots=True)
class Nonsense(DeviceFault):
    """What arrives from the base is noise. The base's watchdog stops it."""

    kind: ClassVar[str] = "nonsense"
    part: ClassVar[str] = "base"
    what: ClassVar[str] = "base answers nonsense"
    detail: ClassVar[str] = "what arrives is not the protocol"
    stops_motion_after_s: ClassVar[float | None] = WATCHDOG_S
    odometry_arrives: ClassVar[bool] = False


@dataclass(frozen=True, slots=True)
class Stall(DeviceFault):
    """The wheels are held. The line works, so the base reports how far it came."""

    kind: ClassVar[str] = "stall"
    part: ClassVar[str] = "base"
    what: ClassVar[str] = "stalled"
    detail: ClassVar[str] = "the wheels do not turn as they were told to"
    stops_motion_after_s: ClassVar[float | None] = 0.0


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
class CameraFrozen(PassingFault):
    """The camera delivers its last picture again and again, as if it were new."""

    kind: ClassVar[str] = "camera_frozen"

    @property
    def words(self) -> str:
        return f"the camera delivers one picture for {self.duration_s:g} s"

    def apply(self, body: FaultTarget) -> None:
        body.freeze_camera(self.duration_s)


@dataclass(frozen=True, slots=True)
class PicturesLag(Fault):
    """From then on pictures show what was to be seen a while before, and nothing says so.

    Attributes:
        lag_s: how long before [s].
    """

    kind: ClassVar[str] = "pictures_lag"
    bounds: ClassVar[Mapping[str, Bounds]] = {"lag_s": DURATION}

    lag_s: float = 0.3

    @property
    def words(self) -> str:
        return f"pictures come {self.lag_s:g} s late from then on"

    def apply(self, body: FaultTarget) -> None:
        body.delay_camera(self.lag_s)


@dataclass(frozen=True, slots=True)
class OdometryJumps(Fault):
    """From then on the count of the wheels jumps in each motion ahead that is told at once, and they go as before.

    Attributes:
        most_m: by how much at most, ahead or back [m].
    """

    kind: ClassVar[str] = "odometry_jumps"
    bounds: ClassVar[Mapping[str, Bounds]] = {"most_m": Bounds(0.0, 10.0, above=True)}

    most_m: float = 0.3

    @property
    def words(self) -> str:
        return f"the wheels' count jumps by up to {self.most_m:g} m in each motion from then on"

    def apply(self, body: FaultTarget) -> None:
        body.miscount(self.most_m)


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

    @property
    def words(self) -> str:
        return "something knocks against the camera, which is turned from then on"

    def apply(self, body: FaultTarget) -> None:
        body.turn_camera(self.tilt_rad, self.roll_rad, self.yaw_rad)
