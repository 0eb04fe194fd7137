"""The reference of all settings: what ``harvey settings`` prints, as tables."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby

from docs.tools.site.markdown import escape, table
from harvey.commands.listing import describe_room, format_value, select_rows
from knowledge_sources.settings import Row


def describe_settings() -> str:
    """A table for each room."""
    rooms = groupby(select_rows(None), key=lambda row: row.room)
    return "\n".join(line for room, rows in rooms for line in _describe_room(room, rows))


def _describe_room(room: str, rows: Iterator[Row]) -> Iterator[str]:
    yield from (f"## {room}", "", f"{escape(describe_room(room))}.")
    yield from table(("name", "value", "meaning", "source"), [
        (f"`{row.name}`", escape(format_value(row)), escape(row.what), escape(row.source)) for row in rows])
