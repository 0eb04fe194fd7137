"""Settings from ``--set KEY=VALUE``: numbers of the methods, and what the robot believes of itself (§3.2).

What the robot believes of itself are values of its entries on the board. They come from the mission; ``--set`` changes
what is believed, never what is true. The keys that a mission's file understands are separated from both.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from harvey.errors import BadInput
from knowledge_sources.settings import DEFAULT, Row, Settings, list_rows, replace_value
from world_models.actuator import ActuatorModel
from world_models.entries import CameraState, Footprint, Wheels
from world_models.files.toml.settings_reader import parse_value, spellings, suggest_keys
from world_models.units import Bounds, bounds_of

BY_MISSION = "by the mission"
"""Instead of a value that has no default."""
MAX_PX = 1e5
ROOMS: Mapping[str, str] = {
    "camera": "camera and mounting, as the robot believes them (entry CameraState)",
    "wheels": "actuator model, as the robot believes it (entry Wheels)",
    "footprint": "extent on the floor, as the robot believes it (entry Footprint)",
}


@dataclass(frozen=True, slots=True)
class RobotValue:
    """A value of an entry.

    Attributes:
        kind: of the entry; part: its attribute that has the value, "" for itself; field: the attribute there.
        row: as ``harvey settings`` tells it.
        bounds: of the value.
    """

    kind: type[Any]
    part: str
    field: str
    row: Row
    bounds: Bounds

    def change(self, entry: Any, value: float) -> Any:
        """The entry's value with this one set; itself where it is so already."""
        holder = getattr(entry, self.part) if self.part else entry
        if getattr(holder, self.field) == value:
            return entry
        changed = replace(holder, **{self.field: value})
        return replace(entry, **{self.part: changed}) if self.part else changed


_LENS, _MOUNT = (CameraState, "lens", "camera"), (CameraState, "mount", "camera")
_WHEELS = (Wheels, "actuator", "wheels")


def _value(
    where: tuple[type[Any], str, str], key: str, field: str, bounds: Bounds, unit: str, what: str,
    default: float | str = BY_MISSION,
) -> RobotValue:
    kind, part, room = where
    return RobotValue(kind, part, field, Row(room, key, default, unit, what, "§3.2"), bounds)


def _wheels(field: str, unit: str, what: str) -> RobotValue:
    return _value(_WHEELS, field, field, bounds_of(ActuatorModel)[field], unit, what, getattr(ActuatorModel(), field))


_FOCAL, _CENTRE = Bounds(1.0, MAX_PX), Bounds(-MAX_PX, MAX_PX)
VALUES = (
    _value(_MOUNT, "height_m", "height_m", Bounds(0.0, 5.0, above=True), "m", "Optical centre above the floor."),
    _value(_MOUNT, "forward_m", "forward_m", Bounds(-2.0, 2.0), "m", "Optical centre ahead of the turning axis."),
    _value(_MOUNT, "tilt_rad", "tilt_rad", Bounds(-math.pi / 2.0, math.pi / 2.0), "rad",
           "Downward tilt of the optical axis."),
    _value(_MOUNT, "roll_rad", "roll_rad", Bounds(-0.8, 0.8), "rad", "Roll about it, its right side low.", 0.0),
    _value(_MOUNT, "yaw_rad", "yaw_rad", Bounds(-0.8, 0.8), "rad", "Turn from the robot's heading to the left.", 0.0),
    _value(_LENS, "fx_px", "fx", _FOCAL, "px", "Focal length along a row of the picture."),
    _value(_LENS, "fy_px", "fy", _FOCAL, "px", "Focal length along a column of the picture."),
    _value(_LENS, "cx_px", "cx", _CENTRE, "px", "Column of the principal point."),
    _value(_LENS, "cy_px", "cy", _CENTRE, "px", "Row of the principal point."),
    _wheels("reach", "1", "Metres driven per metre commanded."),
    _wheels("reach_sigma", "1", "Standard deviation of that factor, between robots and moves."),
    _wheels("curvature_sigma_per_m", "1/m", "Standard deviation of the curvature of a move."),
    _wheels("bend_sigma_per_m", "1/m", "Standard deviation of one move's curvature round the mean of the same wheels."),
    _wheels("turn_sigma", "1", "Standard deviation of a turn's error, as a part of the turn."),
    _wheels("turn_sigma_rad", "rad", "Constant part of that standard deviation."),
    _wheels("skitter_m", "m", "Sideways slip of the tyres in a turn, along each axis."),
    _wheels("increment_m", "m", "Distance between corrections."),
    _wheels("turn_increment_rad", "rad", "Largest turn between corrections."),
    _wheels("speed_m_per_s", "m/s", "Speed of a motion that is corrected on the move."),
    _wheels("brake_m_per_s2", "m/s^2", "Smallest deceleration when stopping."),
    _value((Footprint, "", "footprint"), "radius_m", "radius_m", Bounds(0.02, 2.0), "m", "Radius of the robot's disc."),
)
_KEYS: Mapping[str, tuple[RobotValue, float]] = {
    f"{value.row.room}.{key}": (value, factor)
    for value in VALUES for key, factor in spellings(value.row.field).items()}
KEYS = tuple(_KEYS)
"""Every key that is understood; lengths may be set in feet and inches too, angles in degrees."""


def list_robot_rows() -> tuple[Row, ...]:
    """Every value, as ``harvey settings`` lists the settings."""
    return tuple(value.row for value in VALUES)


def find_key(key: str) -> str:
    """The name under which ``harvey settings`` lists a value, whichever unit its key has."""
    return _KEYS[key][0].row.name if key in _KEYS else key


Believed = Callable[[Any], Any]
"""The value of an entry of the robot as it is to be; the same object where it is so already."""


def build_believed(pairs: Iterable[tuple[str, str]]) -> Believed:
    """What the robot is to believe of itself, by those of the (key, value) pairs that concern it.

    Raises:
        BadInput: a value is no number, or out of its bounds.
    """
    wanted = [(_KEYS[key][0], _parse(key, text)) for key, text in pairs if key in _KEYS]

    def change(entry: Any) -> Any:
        for value, number in wanted:
            if isinstance(entry, value.kind):
                entry = value.change(entry, number)
        return entry

    return change


def _parse(key: str, text: str) -> float:
    value, factor = _KEYS[key]
    number = parse_value(text)
    if isinstance(number, bool) or not isinstance(number, int | float) or not value.bounds.contains(number * factor):
        raise BadInput(f"--set {key}: expected a number {value.bounds.describe(factor)}, got {text!r}")
    return float(number * factor)

Pairs = tuple[tuple[str, str], ...]
"""(key, value) as in ``--set key=value``."""


def names() -> tuple[str, ...]:
    """Every key of an agent: numbers of its methods, and what it believes of itself."""
    return (*(row.name for row in list_rows()), *KEYS)


def build_settings(pairs: Iterable[tuple[str, str]], others: Sequence[str] = ()) -> Settings:
    """The default settings with some values replaced; ``others`` are further keys that the caller understands.

    What the robot believes of itself is checked as well, but is no setting.

    Raises:
        BadInput: a name is unknown (near ones are listed), or a value is not of its setting's kind.
    """
    pairs, settings = tuple(pairs), DEFAULT
    build_believed(pairs)
    for key, value in pairs:
        if key not in names():
            raise unknown(key, others)
        if key in KEYS:
            continue
        try:
            settings = replace_value(settings, key, parse_value(value))
        except ValueError as error:
            raise BadInput(f"--set {key}: {error}, got {value!r}") from None
    return settings


def split_settings(settings: Mapping[str, Any], mission_keys: Sequence[str]) -> tuple[dict[str, Any], Pairs]:
    """The settings that a mission's file understands, and those of the agent, as ``run.json`` keeps them.

    Raises:
        BadInput: a key is unknown (near ones of both are listed), or a value is not of its agent setting's kind.
    """
    for key in settings:
        if key not in mission_keys and key not in names():
            raise unknown(key, mission_keys)
    numbers = tuple((key, _format_value(value)) for key, value in settings.items() if key not in mission_keys)
    build_settings(numbers)
    return {key: value for key, value in settings.items() if key in mission_keys}, numbers


def _format_value(value: Any) -> str:
    """A value as after ``--set``."""
    if isinstance(value, bool):
        return "on" if value else "off"
    return str(value)


def unknown(key: str, others: Sequence[str] = ()) -> BadInput:
    """The error for a key that neither the mission nor the agent has."""
    expected = suggest_keys(key, (*others, *names()))
    return BadInput(f"--set {key}: expected {expected}, got {key!r} (harvey settings lists all)")
