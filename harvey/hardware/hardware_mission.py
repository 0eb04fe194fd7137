"""A mission on hardware, read from its file: world, goal, start, base, camera and wheels.

``docs/flat/mission.toml`` is an example.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from harvey.errors import BadInput
from logs.run_head import RunHead
from world_models.actuator import ActuatorModel
from world_models.files.toml.mission import TABLES, Mission, MissionFormat
from world_models.files.toml.source import Source, WorldError


@dataclass(frozen=True, slots=True)
class BaseSettings:
    """The base.

    Attributes:
        port: ``denning:/dev/ttyUSB0``, ``p2os:...`` or ``create2:...``; what follows the colon is a device, or a URL
            of ``socket://``, ``rfc2217://`` or ``loop://``; of ``ros2:`` a robot's file, or a router's address.
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
        source: number of a device, a file, or a URL, as ``0`` or ``http://127.0.0.1:8080/stream.mjpg``; or
            ``ros2:robot.toml``.
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
class RangeSettings:
    """The base's range sensors.

    Attributes:
        read: whether they are read with each picture: sonars, or the light bumper of a Create 2.
    """

    read: bool = False


FORMAT = MissionFormat({
    **TABLES, "base": BaseSettings, "camera": EyeSettings, "actuator": ActuatorModel, "ranges": RangeSettings})


@dataclass(frozen=True, eq=False, kw_only=True)
class HardwareMission(Mission):
    """A mission and the robot that drives it; the tables of the file are the attributes of the same name."""

    base: BaseSettings
    camera: EyeSettings
    actuator: ActuatorModel
    ranges: RangeSettings

    @property
    def calibration(self) -> Path:
        """The camera file."""
        return self.folder / self.camera.calibration


def load_mission(path: Path | None, settings: Mapping[str, Any]) -> HardwareMission:
    """Read a mission's file, with some settings replaced or, without a file, with nothing but settings.

    Args:
        settings: ``{"base.port": "denning:/dev/ttyUSB0", "goal": "(ptrans ...)"}``; texts as after ``--set``.

    Raises:
        BadInput: the file cannot be read, a key is unknown or lacking, or a value is of the wrong kind.
    """
    try:
        source = Source("the options", {}) if path is None else Source.read(path)
        name, folder = ("drive", Path()) if path is None else (path.stem, path.parent)
        return _mission(source, settings, name, folder)
    except WorldError as error:
        raise BadInput(str(error)) from None


def rebuild_mission(head: RunHead, settings: Mapping[str, Any]) -> HardwareMission:
    """The mission of a run that was begun on hardware, with some settings replaced; see :func:`load_mission`."""
    try:
        return _mission(Source("run.json", head.scenario), settings, head.name, Path(head.folder))
    except WorldError as error:
        raise BadInput(str(error)) from None


def _mission(source: Source, settings: Mapping[str, Any], name: str, folder: Path) -> HardwareMission:
    source = FORMAT.with_settings(source, settings)
    return HardwareMission(**FORMAT.read(source, name, folder))
