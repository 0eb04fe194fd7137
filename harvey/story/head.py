"""Which run it is: its name and seed, and which servo levels were off, as its files say before the first cycle."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from harvey.run_files.run_directory import RunDirectory

WITHOUT: Mapping[str, str] = {
    "action": "no landmark was followed, and it drove by dead reckoning between milestones",
    "plan": "no pose was taken over from a milestone",
    "goal": "a robot that is lost does not look for where it is",
}
"""What it means that a level is off."""


def run_name(run: RunDirectory) -> str:
    """``hallway-kidnap, seed 0``; the directory's name where its head cannot be read."""
    head = _head(run)
    name, seed = head.get("name"), head.get("seed")
    if not isinstance(name, str):
        return run.path.resolve().name
    return f"{name}, seed {seed}" if isinstance(seed, int) and head.get("kind") == "simulator" else name


def levels_off(run: RunDirectory) -> Iterator[str]:
    """Which servo levels were switched off, as run.json says; nothing where it does not."""
    head = _head(run)
    try:
        servo = {
            **head["servo"],
            **{
                key.removeprefix("servo."): value == "on"
                for key, value in head["constants"]
                if key.startswith("servo.")
            },
        }
    except (AttributeError, ValueError, KeyError, TypeError):
        return
    for level, is_on in servo.items():
        if is_on is False:
            yield f"The {level} level of servoing was off in this run: {WITHOUT.get(level, 'nobody closed it')}."


def _head(run: RunDirectory) -> dict[str, Any]:
    try:
        head = json.loads((run.path / "run.json").read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return head if isinstance(head, dict) else {}
