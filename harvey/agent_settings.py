"""Settings of an agent from ``--set ROOM.NAME=VALUE``: told apart from a mission's, checked and put together."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from harvey.errors import BadInput
from knowledge_sources.settings import DEFAULT, Settings
from knowledge_sources.settings.table import list_rows, replace_value
from world_models.files.toml.settings import parse_value, suggest_keys

Pairs = tuple[tuple[str, str], ...]
"""(key, value) as in ``--set key=value``."""


def names() -> tuple[str, ...]:
    """Every name that :func:`build_settings` understands."""
    return tuple(row.name for row in list_rows())


def build_settings(pairs: Iterable[tuple[str, str]], others: Sequence[str] = ()) -> Settings:
    """The default settings with some values replaced; ``others`` are keys that the caller understands beside them.

    Raises:
        BadInput: a name is unknown (near ones are listed), or a value is not of its setting's kind.
    """
    settings = DEFAULT
    for key, value in pairs:
        if key not in names():
            raise unknown(key, others)
        try:
            settings = replace_value(settings, key, parse_value(value))
        except ValueError as error:
            raise BadInput(f"--set {key}: {error}, got {value!r}") from None
    return settings


def split_pairs(pairs: Pairs, mission_keys: Sequence[str]) -> tuple[Pairs, Pairs]:
    """The pairs that a mission's file understands, and those that are settings of the agent.

    Raises:
        BadInput: neither does; near names of both are listed.
    """
    for key, _ in pairs:
        if key not in mission_keys and key not in names():
            raise unknown(key, mission_keys)
    return tuple(p for p in pairs if p[0] in mission_keys), tuple(p for p in pairs if p[0] not in mission_keys)


def unknown(key: str, others: Sequence[str] = ()) -> BadInput:
    """What to say of a key that nobody understands."""
    expected = suggest_keys(key, (*others, *names()))
    return BadInput(f"--set {key}: expected {expected}, got {key!r} (harvey settings lists all)")
