"""A mission on hardware, as its file tells it: world, goal, start, base, camera and wheels.

``docs/flat/mission.toml`` is an example.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from harvey.errors import BadInput
from harvey.run_files.run_head import RunHead
from sim.scenario import ROOT, Arrival, Servo, Start
from world_models.actuator import ActuatorModel
from world_models.bounds import Bounds, check_bounds
from world_models.entries.location import diagonal
from world_models.entries.task import Command
from world_models.files.compiled.schema import SUFFIXES
from world_models.files.toml.settings import MOST, known_keys, merged, near, parsed, read_settings
from world_models.files.toml.source import Node, Source, WorldError
from world_models.phrases import check_command


@dataclass(frozen=True, slots=True)
class BaseSettings:
    """The base.

    Attributes:
        port: ``denning:/dev/ttyUSB0``, ``p2os:...`` or ``create2:...``; what follows the colon is a device, or a URL
            that pyserial knows.
        radius_m: of the robot's disc.
    """

    port: str = ""
    radius_m: float = 0.35

    def __post_init__(self) -> None:
        if not 0.02 <= self.radius_m <= 2.0:
            raise ValueError(f"expected a radius of 0.02 to 2 m, got {self.radius_m}")


@dataclass(frozen=True, slots=True)
class EyeSettings:
    """The camera.

    Attributes:
        source: number of a device, a file, or a URL, as ``0`` or ``http://127.0.0.1:8080/stream.mjpg``.
        calibration: the file that ``harvey calibrate`` wrote: intrinsics, distortion, mounting.
        rate_hz: pictures a second that the mission needs.
        late_s: how long a picture may take to come.
        lag_s: how long one takes from the sensor to here, where that is known.
    """

    source: str = ""
    calibration: str = ""
    rate_hz: float = 5.0
    late_s: float = 1.0
    lag_s: float = 0.0

    def __post_init__(self) -> None:
        if not (0.1 <= self.rate_hz <= 1000.0 and 0.01 <= self.late_s <= 60.0 and 0.0 <= self.lag_s <= 60.0):
            raise ValueError("expected 0.1 to 1000 pictures a second, late after 0.01 to 60 s, a lag of 0 to 60 s, got "
                             f"{self.rate_hz:g}, {self.late_s:g} and {self.lag_s:g}")


@dataclass(frozen=True, slots=True)
class DriveLimits:
    """When to give up."""

    max_time_s: float = 3600.0
    max_cycles: int = 20000

    def __post_init__(self) -> None:
        some = Bounds(0.0, MOST, above=True)
        check_bounds(self, {"max_time_s": some, "max_cycles": some})


SECTIONS: Mapping[str, type[Any]] = {
    "start": Start,
    "arrival": Arrival,
    "base": BaseSettings,
    "camera": EyeSettings,
    "actuator": ActuatorModel,
    "servo": Servo,
    "limits": DriveLimits,
}


@dataclass(frozen=True, eq=False)
class HardwareMission:
    """What to drive, and with what; the tables of the file are the attributes of the same name.

    Attributes:
        name: the file's, without its ending.
        world, calibration: files that are to be there.
        goal: in words, or in conceptual-dependency form with coordinates in feet.
        folder, data: where the file is, and its tables as read.
    """

    name: str
    world: Path
    goal: str
    start: Start
    arrival: Arrival
    base: BaseSettings
    camera: EyeSettings
    actuator: ActuatorModel
    servo: Servo
    limits: DriveLimits
    folder: Path
    data: Mapping[str, Any] = field(default_factory=dict, repr=False)

    @property
    def calibration(self) -> Path:
        return self.folder / self.camera.calibration

    @property
    def command(self) -> Command:
        """What is asked for, and how the robot was put down."""
        s = self.start
        covariance = diagonal(max(s.put_down_sigma_m, 0.005), max(s.put_down_sigma_rad, 0.005))
        heading = self.arrival.heading_rad if self.arrival.matters else None
        return Command(self.goal, s.heading_rad, heading, covariance)


def load_mission(path: Path | None, settings: Mapping[str, Any]) -> HardwareMission:
    """Read a mission's file, with some settings replaced or, without a file, with nothing but settings.

    Args:
        settings: ``{"base.port": "denning:/dev/ttyUSB0", "goal": "(ptrans ...)"}``; texts as after ``--set``.

    Raises:
        BadInput: the file cannot be read, a key is unknown or lacking, or a value is of the wrong kind.
    """
    try:
        source = Source("the options", {}, {}) if path is None else Source.read(path)
        data = _with(source.data, settings)
        folder = Path() if path is None else path.parent
        return _mission(Source(source.name, data, source.lines).root, "drive" if path is None else path.stem, folder)
    except WorldError as error:
        raise BadInput(str(error)) from None


def mission_again(head: RunHead, settings: Mapping[str, Any]) -> HardwareMission:
    """The mission of a run that was begun on hardware, with some settings replaced; see :func:`load_mission`."""
    try:
        return _mission(Source("run.json", _with(head.scenario, settings), {}).root, head.name, Path(head.folder))
    except WorldError as error:
        raise BadInput(str(error)) from None


def keys() -> tuple[str, ...]:
    """Every key that may be set."""
    return ("world", "goal", *(f"{name}.{key}" for name, kind in SECTIONS.items() for key in known_keys(kind)))


def _with(tables: Mapping[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
    data = dict(tables)
    for key, value in settings.items():
        data = _replaced(data, key, value)
    return data


def _replaced(data: dict[str, Any], key: str, value: Any) -> dict[str, Any]:
    if key not in keys():
        raise WorldError(f"--set {key}: expected {near(key, keys())}, got {key!r}")
    texts = ("world", "goal", "base.port", "camera.source", "camera.calibration")
    return merged(data, tuple(key.split(".")), value if key in texts or not isinstance(value, str) else parsed(value))


def _mission(root: Node, name: str, folder: Path) -> HardwareMission:
    node = root.table(("world", "goal"), tuple(SECTIONS))
    sections = {key: read_settings(node[key], kind) if key in node else kind() for key, kind in SECTIONS.items()}
    mission = HardwareMission(
        name=name, world=_world(node["world"].text(), folder), goal=_goal(node["goal"]), folder=folder,
        data=root.source.data, **sections,
    )
    if not math.isfinite(mission.start.heading_rad):
        raise node.fail("a heading at the start")
    return mission


def _world(text: str, folder: Path) -> Path:
    """A world that comes with the project, by its bare name, or any file, relative to the mission's folder."""
    return folder / text if text.endswith((".toml", *SUFFIXES)) else ROOT / "world_models" / "worlds" / f"{text}.toml"


def _goal(node: Node) -> str:
    try:
        check_command(node.text())
    except WorldError:
        raise
    except ValueError as error:
        raise WorldError(f"{node.where}: goal: {error}") from None
    return node.text()
