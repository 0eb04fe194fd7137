"""``harvey settings``: every number of the methods and knowledge sources, with unit, meaning and source."""

from __future__ import annotations

import json
import shutil
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator, Sequence
from itertools import groupby, zip_longest
from math import degrees
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from harvey.commands.command import Command
from harvey.errors import BadInput

if TYPE_CHECKING:
    from knowledge_sources.settings import Row

MIN_WIDTH, MAX_WIDTH = 80, 160
"""Columns of the terminal that a table takes."""
SOURCE_WIDTH = 24


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("room", metavar="ROOM", nargs="?", help="one room, or one setting as plan.max_leg_m (all)")
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")


def _run(args: Namespace) -> int:
    rows = select_rows(args.room)
    if args.json:
        print(json.dumps([to_record(row) for row in rows], indent=2, ensure_ascii=False))
        return 0
    width = min(max(shutil.get_terminal_size((120, 24)).columns, MIN_WIDTH), MAX_WIDTH)
    print("\n".join(format_rows(rows, width)))
    print("\nAn angle is set in radians. One number is replaced by --set ROOM.NAME=VALUE, in harvey run and replay.\n"
          "Those of camera, wheels and footprint may be set in other units too: camera.tilt_deg, camera.height_in.")
    return 0


def select_rows(name: str | None) -> tuple[Row, ...]:
    """All settings, those of a room, or one. Raises BadInput where there is no such room or setting."""
    from harvey.robot_settings import find_key, list_robot_rows
    from knowledge_sources.settings import list_rows
    from world_models.files.toml.settings import suggest_keys

    rows, name = (*list_rows(), *list_robot_rows()), name and find_key(name)
    chosen = tuple(row for row in rows if name in (None, row.room, row.name))
    if not chosen:
        known = [*dict.fromkeys(row.room for row in rows), *(row.name for row in rows)]
        raise BadInput(f"ROOM: expected {suggest_keys(str(name), known)}, got {name!r}")
    return chosen


def to_record(row: Row) -> dict[str, Any]:
    """A setting as JSON types."""
    value = list(row.value) if isinstance(row.value, tuple) else row.value
    return {"name": row.name, "value": value, "unit": row.unit, "meaning": row.what, "source": row.source}


def format_rows(rows: Sequence[Row], width: int) -> Iterator[str]:
    """One table for each room, as wide as said: name, value with unit, meaning, source."""
    for number, (room, group) in enumerate(groupby(rows, key=lambda row: row.room)):
        yield f"{chr(10) * (number > 0)}{room}: {describe_room(room)}"
        yield ""
        yield from _format_room(list(group), width)


def describe_room(room: str) -> str:
    """What a room's numbers are for, as its dataclass says."""
    from harvey.robot_settings import ROOMS
    from knowledge_sources.settings import DEFAULT

    if room in ROOMS:
        return ROOMS[room]
    return (getattr(DEFAULT, room).__doc__ or "").strip().splitlines()[0].rstrip(".").removeprefix("The ")


def _format_room(rows: Sequence[Row], width: int) -> Iterator[str]:
    values = [format_value(row) for row in rows]
    name, value = max(len(row.field) for row in rows), max(map(len, values))
    source = min(SOURCE_WIDTH, max(len(row.source) for row in rows))
    meaning = max(width - name - value - source - 8, 24)
    for row, text in zip(rows, values, strict=True):
        lines = zip_longest(wrap(row.what, meaning), wrap(row.source, source), fillvalue="")
        for number, (what, where) in enumerate(lines):
            first, second = (row.field, text) if number == 0 else ("", "")
            yield f"  {first:<{name}}  {second:<{value}}  {what:<{meaning}}  {where}".rstrip()


def format_value(row: Row) -> str:
    """A value with its unit; an angle in degrees too."""
    if isinstance(row.value, str):
        return row.value
    if isinstance(row.value, bool):
        return "on" if row.value else "off"
    unit = "" if row.unit in ("1", "count") else f" {row.unit}"
    if isinstance(row.value, tuple):
        numbers = f"{len(row.value)} values" if len(row.value) > 4 else " ".join(f"{n:g}" for n in row.value)
        return f"{numbers}{unit}"
    return f"{row.value:.4g}{unit}" + (f" ({degrees(row.value):.3g} deg)" if row.unit == "rad" else "")


COMMAND = Command(
    "settings", "every number of the methods: value, unit, meaning and source",
    (
        ("harvey settings", "all rooms"),
        ("harvey settings matching", "one room"),
        ("harvey settings plan.max_leg_m", "one number"),
        ("harvey settings camera", "what the robot believes of its camera"),
        ("harvey settings --json", "for further use"),
        ("harvey run bump --set plan.max_leg_m=2", "run with another number"),
        ("harvey replay runs/bump-0 --set plan.max_leg_m=2", "decide a run again with another number"),
    ),
    _arguments, _run,
    "They belong to the robot's software. The numbers of a scenario (start, sensor, wheels, faults) are in its file.\n"
    "Camera, wheels and footprint are what the robot believes of itself: set, they change that and not what is true.",
)
