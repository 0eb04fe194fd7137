"""Every number that can be set, one frozen dataclass for each room; ``harvey settings`` prints them.

A number is set here where an experiment, a scenario or a document varies it; all others are constants next to their
use. ``--set ROOM.NAME=VALUE`` replaces one. A function takes the settings of its own room, or :class:`Settings`
where it also calls other rooms.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

Value = float
"""Of a setting: a number, or ``True`` and ``False``."""

SWITCHES: Mapping[str, bool] = {"on": True, "yes": True, "true": True, "off": False, "no": False, "false": False}
"""What may be written for a setting that is on or off."""


def setting(default: float, unit: str, what: str, source: str = "engineering judgement") -> Any:
    """A field of a settings dataclass.

    Args:
        default: a whole number where only whole numbers make sense, ``True`` or ``False`` for a switch.
        unit: ``px``, ``m``, ``rad``, ``s``, ``1`` for a ratio or a probability, ``count``, ``yes/no``.
        what: one sentence, without the unit.
        source: section or equation of the paper, or the experiment that chose it; what nobody measured is judgement.
    """
    return field(default=default, metadata={"unit": unit, "what": what, "source": source})


@dataclass(frozen=True, slots=True)
class ActionSettings:
    """The numbers of the knowledge sources of the action level (§5)."""

    # Tolerance of the action level
    min_tolerance_px: float = setting(
        4.0, "px", "Floor of the tolerance in the image: what correlation alone may be wrong by.")

    # Floor ahead: motor and path follower
    keeps_to_seen_floor: bool = setting(
        True, "yes/no",
        "Whether the robot drives only where it has seen the floor free; else it looks or creeps.", "§4")
    max_seen_age_s: float = setting(60.0, "s", "What was seen to be free longer ago must be seen again.")
    creep_speed_m_per_s: float = setting(
        0.09, "m/s", "Speed into floor that was not seen to be free: a certain touch is borne at it. At any other speed"
        " the expected harm of a touch, its probability times its squared speed, is no greater.")
    max_looks: int = setting(4, "count", "Most looks round on one leg.")

    # Things on the floor
    obstacle_width_m: float = setting(0.45, "m", "Width and depth that something touched is taken to have.")
    act_within_m: float = setting(
        0.7, "m", "What may stand in the next so much of the way is held to be there: nearer it is not seen at all.",
        "the picture's lower border shows floor 1.3 m ahead")
    max_obstacle_certainty: float = setting(
        0.99, "1", "No obstacle is more certain than this, so that what is gone is soon forgotten.")
    min_gone_certainty: float = setting(0.5, "1", "An obstacle that is less certain is gone.")
    min_footprint_change_m: float = setting(
        0.1, "m", "A frame is revised when an obstacle's footprint turns out differently by so much.")


@dataclass(frozen=True, slots=True)
class PlanSettings:
    """The numbers of the knowledge sources of the plan level (§4, §6)."""

    # Tolerance of the plan level
    max_deviation_px: float = setting(
        30.0, "px", "Bound of the plan level: how far the matcher looks for what is expected.", "§6.1.4")

    # Sketchers
    overhang_m: float = setting(
        0.15, "m",
        "So much wider than its feet something that the model lacks may be: where there is room, the way is led so"
        " much farther round it, and nearer to it the robot drives slower.")
    max_lookouts: int = setting(
        6, "count", "So often the robot looks again, from elsewhere, at what leaves no way; then it is blocked.")
    max_leg_m: float = setting(3.6, "m", "Longest leg without a milestone in between.")
    approaches_seeing: bool = setting(
        True, "yes/no", "Whether a doorway is approached, and left behind, from where the floor in it is seen.", "§4")


@dataclass(frozen=True, slots=True)
class FloorSettings:
    """The numbers of the methods that see free floor, with a camera or range sensors."""

    # Which parts are used
    use_appearance: bool = setting(True, "yes/no", "What does not look like the floor is a thing on it.")
    use_parallax: bool = setting(
        True, "yes/no", "Two pictures tell whether it stands up from the floor or lies flat on it.")
    use_ranges: bool = setting(True, "yes/no", "Range sensors tell of free floor too, where the robot has any.")

    # How far
    max_untold_m: float = setting(
        0.15, "m",
        "Depth of floor beside the model's own parts that is taken to be free, though its looks tell nothing there.")


@dataclass(frozen=True, slots=True)
class Settings:
    """The settings of all rooms."""

    action: ActionSettings = field(default_factory=ActionSettings)
    plan: PlanSettings = field(default_factory=PlanSettings)
    floor: FloorSettings = field(default_factory=FloorSettings)


DEFAULT = Settings()
"""The default settings."""


@dataclass(frozen=True, slots=True)
class Row:
    """One setting.

    Attributes:
        room, field: where it is found; value: as it is set, or in words who sets it.
        unit, what, source: as :func:`setting` takes them.
    """

    room: str
    field: str
    value: Value | str
    unit: str
    what: str
    source: str

    @property
    def name(self) -> str:
        """As ``--set`` takes it: ``plan.max_leg_m``."""
        return f"{self.room}.{self.field}"


def list_rows(settings: Settings = DEFAULT) -> tuple[Row, ...]:
    """Every setting of every room, in the order in which they are defined."""
    rooms = ((room.name, getattr(settings, room.name)) for room in fields(settings))
    return tuple(
        Row(name, f.name, getattr(room, f.name), **f.metadata)
        for name, room in rooms for f in fields(room)
    )


def replace_value(settings: Settings, name: str, value: Any) -> Settings:
    """The settings with one value replaced.

    Raises:
        KeyError: there is no setting of that name.
        ValueError: the value is not of the kind of the default; says what was expected.
    """
    row = {row.name: row for row in list_rows()}[name]
    changed = replace(getattr(settings, row.room), **{row.field: _convert(value, row)})
    return replace(settings, **{row.room: changed})


def _convert(value: Any, row: Row) -> Value:
    """The value as one of the setting's kind. Raises ValueError."""
    default = row.value
    if isinstance(default, bool):
        is_on = SWITCHES.get(str(value).lower())
        if is_on is None:
            raise ValueError("expected on or off")
        return is_on
    if not _is_number(value) or (isinstance(default, int) and not value == int(value) >= 0):
        raise ValueError(f"expected a {'whole ' * isinstance(default, int)}number as {default:g}")
    return int(value) if isinstance(default, int) else float(value)


def _is_number(value: Any) -> bool:
    """Whether it is a finite number; ``on`` and ``off`` are none."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < float("inf")
