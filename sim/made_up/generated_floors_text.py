"""World files as text: as much TOML as a world file needs."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

Table = dict[str, Any]


def as_toml(data: Mapping[str, Any]) -> str:
    """Format a world file: plain values first, then its tables."""
    lines = [f"{key} = {_value(value)}" for key, value in data.items() if not isinstance(value, Mapping)]
    for table, entries in data.items():
        if isinstance(entries, Mapping):
            lines += ["", f"[{table}]"]
            flat = table in ("finishes", "defaults", "parts", "doors")
            lines += [f"{key} = {_value(value)}" for key, value in entries.items() if flat]
            for key, value in entries.items() if not flat else ():
                lines += ["", f"[{table}.{key}]", *(f"{k} = {_value(v)}" for k, v in value.items())]
    return "\n".join(lines) + "\n"


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    return json.dumps(value)


def scale_colour(finish: Mapping[str, Any], gain: float) -> Table:
    """Scale the colour of a finish."""
    return {**finish, "colour": [round(min(1.0, gain * channel), 4) for channel in finish["colour"]]}


def replace_finishes(boxes: Sequence[Mapping[str, Any]], finish: Callable[[str], str]) -> list[Table]:
    """Replace the finishes of a part's boxes."""
    return [{key: finish(value) if key in ("finish", "rim") else value for key, value in box.items()} for box in boxes]
