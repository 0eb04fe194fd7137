"""All settings as rows of one table, and how to replace one of them by its name."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

from knowledge_sources.settings import DEFAULT, Settings
from knowledge_sources.settings.setting import Value


@dataclass(frozen=True, slots=True)
class Row:
    """One setting.

    Attributes:
        room, field: where it is found; value: as it is set.
        unit, what, source, most, choices: as :func:`knowledge_sources.settings.setting.setting` takes them.
    """

    room: str
    field: str
    value: Value
    unit: str
    what: str
    source: str
    most: float
    choices: tuple[str, ...]

    @property
    def name(self) -> str:
        """As ``--set`` takes it: ``matching.max_x_px``."""
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
        ValueError: the value is not of the kind of the default, or too large; says what was expected.
    """
    row = {row.name: row for row in list_rows()}[name]
    changed = replace(getattr(settings, row.room), **{row.field: _convert(value, row)})
    return replace(settings, **{row.room: changed})


def _convert(value: Any, row: Row) -> Value:
    """The value as one of the setting's kind. Raises ValueError."""
    default = row.value
    if isinstance(default, str):
        if value in row.choices:
            return str(value)
        raise ValueError(f"expected {' or '.join(row.choices)}")
    if isinstance(default, bool):
        if isinstance(value, bool):
            return value
        raise ValueError("expected on or off")
    if isinstance(default, tuple):
        if isinstance(value, list | tuple) and value and all(map(_is_number, value)):
            return tuple(map(float, value))
        raise ValueError(f"expected a list of numbers as {list(default)}")
    if not _is_number(value) or (isinstance(default, int) and not value == int(value) >= 0):
        raise ValueError(f"expected a {'whole ' * isinstance(default, int)}number as {default:g}")
    if value > row.most:
        raise ValueError(f"expected {row.most:g} at most")
    return int(value) if isinstance(default, int) else float(value)


def _is_number(value: Any) -> bool:
    """Whether it is a finite number; ``on`` and ``off`` are none."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < float("inf")
