"""Settings of an agent from ``--set ROOM.NAME=VALUE``: separated from a mission's, checked and combined."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from harvey.errors import BadInput
from harvey.robot_settings import KEYS as ROBOT_KEYS
from harvey.robot_settings import build_believed
from knowledge_sources.settings import DEFAULT, Settings, list_rows, replace_value
from world_models.files.toml.settings import parse_value, suggest_keys

Pairs = tuple[tuple[str, str], ...]
"""(key, value) as in ``--set key=value``."""


def names() -> tuple[str, ...]:
    """Every key of an agent: numbers of its methods, and what it believes of itself."""
    return (*(row.name for row in list_rows()), *ROBOT_KEYS)


def build_settings(pairs: Iterable[tuple[str, str]], others: Sequence[str] = ()) -> Settings:
    """The default settings with some values replaced; ``others`` are keys that the caller understands beside them.

    What the robot believes of itself is checked as well, but is no setting (:mod:`harvey.robot_settings`).

    Raises:
        BadInput: a name is unknown (near ones are listed), or a value is not of its setting's kind.
    """
    pairs, settings = tuple(pairs), DEFAULT
    build_believed(pairs)
    for key, value in pairs:
        if key not in names():
            raise unknown(key, others)
        if key in ROBOT_KEYS:
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
    return str(list(value)) if isinstance(value, tuple) else str(value)


def unknown(key: str, others: Sequence[str] = ()) -> BadInput:
    """The error for a key that neither the mission nor the agent has."""
    expected = suggest_keys(key, (*others, *names()))
    return BadInput(f"--set {key}: expected {expected}, got {key!r} (harvey settings lists all)")
