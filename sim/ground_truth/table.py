"""The ``[truth]`` of a scenario: what differs from the robot's model, from when to when."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from sim.ground_truth.inexact import EXACT, TrueInexact
from sim.ground_truth.things import SHAPES
from world_models.camera import Camera, CameraMount
from world_models.files.toml.settings_reader import MAX_NUMBER, suggest_keys
from world_models.units import Bounded, Bounds, bounded, check_bounds

DOOR_STATES = ("shut", "ajar", "open")
NEVER_S = float(MAX_NUMBER)
"""End of what never ends [s]."""
FAR_M, SHIFT_M, TURN = 1e5, 1000.0, 2.0 * math.pi
"""Largest coordinate and displacement along an axis [m], and largest angle [rad]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lasting(Bounded):
    """Something that is so for a while.

    Attributes:
        at_s: when it begins, by the time of the run.
        until_s: when it ends.
    """

    at_s: float = bounded(0.0, 0.0, NEVER_S)
    until_s: float = NEVER_S

    def __post_init__(self) -> None:
        Bounded.__post_init__(self)
        check_bounds(self, {"until_s": Bounds(self.at_s, NEVER_S, above=True)})


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueDoor(Lasting):
    """The true state of a door: one of ``[[truth.doors]]``.

    Attributes:
        name: the door's.
        state: shut, ajar or open.
        open_rad: angle of a leaf that is ajar.
        into: the locale into which the leaf swings; "" for the first of the two that the door joins.
        hinge: left or right, as seen from inside that locale.
    """

    name: str = ""
    state: str = "shut"
    open_rad: float = bounded(math.radians(45.0), 0.0, math.pi, above=True)
    into: str = ""
    hinge: str = "left"

    def __post_init__(self) -> None:
        Lasting.__post_init__(self)
        _check_choice("state", self.state, DOOR_STATES)
        _check_choice("hinge", self.hinge, ("left", "right"))


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueThing(Lasting):
    """A thing of the model that is elsewhere or nowhere: one of ``[[truth.things]]``.

    Attributes:
        thing: its name, as "allens-office/desk".
        missing: whether it is not there at all.
        x_m, y_m: its displacement in the world frame.
        heading_rad: by how much it is turned, counter-clockwise, about the middle of what it takes of the floor.
    """

    thing: str = ""
    missing: bool = False
    x_m: float = bounded(0.0, -SHIFT_M, SHIFT_M)
    y_m: float = bounded(0.0, -SHIFT_M, SHIFT_M)
    heading_rad: float = bounded(0.0, -TURN, TURN)

    def __post_init__(self) -> None:
        Lasting.__post_init__(self)
        if self.missing == any((self.x_m, self.y_m, self.heading_rad)):
            raise ValueError(f"expected either missing = true or a displacement x_m, y_m or a turn heading_rad of "
                             f"{self.thing or 'a thing'}, got {'both' if self.missing else 'neither'}")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueWall(Lasting):
    """A wall of the model, as one room has it, that is elsewhere or nowhere: one of ``[[truth.walls]]``.

    What belongs to the wall goes with it (baseboards, the frames of its doors), what hangs on it does not.

    Attributes:
        wall: its name: the room and the side, as "allens-office/south-wall".
        missing: whether it is not there at all.
        x_m, y_m: its displacement in the world frame.
    """

    wall: str = ""
    missing: bool = False
    x_m: float = bounded(0.0, -SHIFT_M, SHIFT_M)
    y_m: float = bounded(0.0, -SHIFT_M, SHIFT_M)

    def __post_init__(self) -> None:
        Lasting.__post_init__(self)
        if self.missing == any((self.x_m, self.y_m)):
            raise ValueError(f"expected either missing = true or a displacement x_m, y_m of {self.wall or 'a wall'}, "
                             f"got {'both' if self.missing else 'neither'}")


@dataclass(frozen=True, slots=True, kw_only=True)
class ExtraThing(Lasting):
    """A solid thing that the model lacks: one of ``[[truth.extra]]``.

    Attributes:
        kind: its shape, one of :data:`~sim.ground_truth.things.SHAPES`.
        locale: the room where it stands; x_m, y_m, heading_rad: the middle of its footprint, in that room's frame.
        colour: red, green, blue (0..1) of all of it, in place of its own: [0.5, 0.4, 0.3].
    """

    kind: str = ""
    locale: str = ""
    x_m: float = bounded(0.0, -FAR_M, FAR_M)
    y_m: float = bounded(0.0, -FAR_M, FAR_M)
    heading_rad: float = bounded(0.0, -TURN, TURN)
    colour: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        Lasting.__post_init__(self)
        _check_choice("kind", self.kind, tuple(SHAPES))
        if self.colour and not (len(self.colour) == 3 and all(0.0 <= part <= 1.0 for part in self.colour)):
            raise ValueError(f"expected colour = [red, green, blue], each from 0 to 1, got {list(self.colour)}")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueCamera(Bounded):
    """By how much the true camera differs from the one that the robot believes in: ``[truth.camera]``.

    Attributes:
        tilt_rad: of its mounting, positive downward; roll_rad: clockwise as the camera looks; yaw_rad: to the left.
        height_m: of its mounting; focal_px: of its focal length.
        distortion: of its lens, whole and not by how much it differs, in the order of [camera]; empty: as believed.
    """

    tilt_rad: float = bounded(0.0, -0.5, 0.5)
    roll_rad: float = bounded(0.0, -0.5, 0.5)
    yaw_rad: float = bounded(0.0, -0.5, 0.5)
    height_m: float = bounded(0.0, -1.0, 1.0)
    focal_px: float = bounded(0.0, -2000.0, 2000.0)
    distortion: tuple[float, ...] = ()

    def mounted(self, camera: Camera, mount: CameraMount) -> tuple[Camera, CameraMount]:
        """The true camera and mounting. Raises ValueError where there is no such camera."""
        if self == AS_BELIEVED:
            return camera, mount
        focal = camera.fx + self.focal_px, camera.fy + self.focal_px
        height_m = mount.height_m + self.height_m
        if min(*focal, height_m) <= 0.0:
            raise ValueError(f"expected a focal length above 0 px and a height above 0 m, "
                             f"got {min(focal):g} px and {height_m:g} m")
        return (replace(camera, fx=focal[0], fy=focal[1], distortion=self.distortion or camera.distortion),
                replace(mount, height_m=height_m, tilt_rad=mount.tilt_rad + self.tilt_rad,
                        roll_rad=mount.roll_rad + self.roll_rad, yaw_rad=mount.yaw_rad + self.yaw_rad))


AS_BELIEVED = TrueCamera()


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueStart(Bounded):
    """Where the robot is put down, where that is not the prior place: ``[truth.start]``.

    Attributes:
        locale: the room; x_m, y_m, heading_rad: the pose in its frame, before the errors of putting it down.
    """

    locale: str = ""
    x_m: float = bounded(0.0, -FAR_M, FAR_M)
    y_m: float = bounded(0.0, -FAR_M, FAR_M)
    heading_rad: float = bounded(0.0, -TURN, TURN)


START_AS_STATED = TrueStart()


@dataclass(frozen=True, slots=True, kw_only=True)
class TruthTable:
    """All that differs; of several entries about the same door, thing or wall, the last one that is due holds."""

    doors: tuple[TrueDoor, ...] = ()
    things: tuple[TrueThing, ...] = ()
    walls: tuple[TrueWall, ...] = ()
    extra: tuple[ExtraThing, ...] = ()
    camera: TrueCamera = AS_BELIEVED
    start: TrueStart = START_AS_STATED
    inexact: TrueInexact = EXACT


NO_DIFFERENCES = TruthTable()


def _check_choice(key: str, value: str, known: tuple[str, ...]) -> None:
    if value not in known:
        raise ValueError(f"expected {key} = {suggest_keys(value, known)}, got {value!r}")
