"""The ``[truth]`` of a scenario: what is otherwise than the robot's model says, from when to when."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TypeVar

from sim.ground_truth.inexact import EXACT, TrueInexact
from sim.ground_truth.things import SHAPES
from world_models.camera import Camera, CameraMount
from world_models.files.toml.settings_reader import MAX_NUMBER, read_settings, suggest_keys
from world_models.files.toml.source import Node
from world_models.units import Bounds, check_bounds

T = TypeVar("T")
DOOR_STATES = ("shut", "ajar", "open")
NEVER_S = float(MAX_NUMBER)
"""End of what never ends [s]."""
COORDINATE = Bounds(-1e5, 1e5)
SHIFT = Bounds(-1000.0, 1000.0)
TURN = Bounds(-2.0 * math.pi, 2.0 * math.pi)


@dataclass(frozen=True, slots=True, kw_only=True)
class Lasting:
    """Something that is so for a while.

    Attributes:
        at_s: when it begins, by the time of the run.
        until_s: when it ends.
    """

    at_s: float = 0.0
    until_s: float = NEVER_S

    def __post_init__(self) -> None:
        check_bounds(self, {"at_s": Bounds(0.0, NEVER_S), "until_s": Bounds(self.at_s, NEVER_S, above=True)})


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
    open_rad: float = math.radians(45.0)
    into: str = ""
    hinge: str = "left"

    def __post_init__(self) -> None:
        Lasting.__post_init__(self)
        check_bounds(self, {"open_rad": Bounds(0.0, math.pi, above=True)})
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
    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0

    def __post_init__(self) -> None:
        Lasting.__post_init__(self)
        check_bounds(self, {"x_m": SHIFT, "y_m": SHIFT, "heading_rad": TURN})
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
    x_m: float = 0.0
    y_m: float = 0.0

    def __post_init__(self) -> None:
        Lasting.__post_init__(self)
        check_bounds(self, {"x_m": SHIFT, "y_m": SHIFT})
        if self.missing == any((self.x_m, self.y_m)):
            raise ValueError(f"expected either missing = true or a displacement x_m, y_m of {self.wall or 'a wall'}, "
                             f"got {'both' if self.missing else 'neither'}")


@dataclass(frozen=True, slots=True, kw_only=True)
class ExtraThing(Lasting):
    """A solid thing that the model lacks: one of ``[[truth.extra]]``.

    Attributes:
        kind: its shape, one of :data:`~sim.ground_truth.things.SHAPES`.
        locale: the room where it stands; x_m, y_m, heading_rad: the middle of its footprint, in that room's frame.
    """

    kind: str = ""
    locale: str = ""
    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0

    def __post_init__(self) -> None:
        Lasting.__post_init__(self)
        check_bounds(self, {"x_m": COORDINATE, "y_m": COORDINATE, "heading_rad": TURN})
        _check_choice("kind", self.kind, tuple(SHAPES))


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueCamera:
    """By how much the true camera differs from the one that the robot believes in: ``[truth.camera]``.

    Attributes:
        tilt_rad: of its mounting, positive downward; roll_rad: clockwise as the camera looks; yaw_rad: to the left.
        height_m: of its mounting; focal_px: of its focal length.
    """

    tilt_rad: float = 0.0
    roll_rad: float = 0.0
    yaw_rad: float = 0.0
    height_m: float = 0.0
    focal_px: float = 0.0

    def __post_init__(self) -> None:
        angle = Bounds(-0.5, 0.5)
        check_bounds(self, {"tilt_rad": angle, "roll_rad": angle, "yaw_rad": angle, "height_m": Bounds(-1.0, 1.0),
                            "focal_px": Bounds(-2000.0, 2000.0)})

    def mounted(self, camera: Camera, mount: CameraMount) -> tuple[Camera, CameraMount]:
        """The true camera and mounting. Raises ValueError where there is no such camera."""
        if self == AS_BELIEVED:
            return camera, mount
        focal = camera.fx + self.focal_px, camera.fy + self.focal_px
        height_m = mount.height_m + self.height_m
        if min(*focal, height_m) <= 0.0:
            raise ValueError(f"expected a focal length above 0 px and a height above 0 m, "
                             f"got {min(focal):g} px and {height_m:g} m")
        return (replace(camera, fx=focal[0], fy=focal[1]),
                replace(mount, height_m=height_m, tilt_rad=mount.tilt_rad + self.tilt_rad,
                        roll_rad=mount.roll_rad + self.roll_rad, yaw_rad=mount.yaw_rad + self.yaw_rad))


AS_BELIEVED = TrueCamera()


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueStart:
    """Where the robot is put down, where that is not the place that it is told: ``[truth.start]``.

    Attributes:
        locale: the room; x_m, y_m, heading_rad: the pose in its frame, before the errors of putting it down.
    """

    locale: str = ""
    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0

    def __post_init__(self) -> None:
        check_bounds(self, {"x_m": COORDINATE, "y_m": COORDINATE, "heading_rad": TURN})


AS_TOLD = TrueStart()


@dataclass(frozen=True, slots=True, kw_only=True)
class TruthTable:
    """All that is otherwise; of several entries about the same door, thing or wall, the last one that is due holds."""

    doors: tuple[TrueDoor, ...] = ()
    things: tuple[TrueThing, ...] = ()
    walls: tuple[TrueWall, ...] = ()
    extra: tuple[ExtraThing, ...] = ()
    camera: TrueCamera = AS_BELIEVED
    start: TrueStart = AS_TOLD
    inexact: TrueInexact = EXACT


NO_DIFFERENCES = TruthTable()


def read_truth(node: Node) -> TruthTable:
    """The table of a file. Raises WorldError."""
    node.table((), ("doors", "things", "walls", "extra", "camera", "start", "inexact"))
    return TruthTable(
        doors=_read_all(node, "doors", TrueDoor), things=_read_all(node, "things", TrueThing),
        walls=_read_all(node, "walls", TrueWall), extra=_read_all(node, "extra", ExtraThing),
        camera=read_settings(node["camera"], TrueCamera) if "camera" in node else AS_BELIEVED,
        start=read_settings(node["start"], TrueStart) if "start" in node else AS_TOLD,
        inexact=read_settings(node["inexact"], TrueInexact) if "inexact" in node else EXACT,
    )


def _read_all(node: Node, key: str, kind: type[T]) -> tuple[T, ...]:
    return tuple(read_settings(item, kind) for item in node[key].items()) if key in node else ()


def _check_choice(key: str, value: str, known: tuple[str, ...]) -> None:
    if value not in known:
        raise ValueError(f"expected {key} = {suggest_keys(value, known)}, got {value!r}")
