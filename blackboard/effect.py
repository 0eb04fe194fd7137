"""Effect: what a knowledge source may ask for. Only the scheduler carries it out."""

from __future__ import annotations

from typing import Any, NamedTuple

from blackboard.entry import Entry


class Post(NamedTuple):
    """Put a new entry on the board."""

    value: Any
    because: tuple[Any, ...] = ()


class Revise(NamedTuple):
    """Replace the value of an entry. ``entry`` is the revision that was seen: if it is stale, the act is refused."""

    entry: Entry[Any]
    value: Any
    because: tuple[Any, ...] = ()


class Retract(NamedTuple):
    """No longer believe an entry. ``entry`` is the revision that was seen."""

    entry: Entry[Any]
    because: tuple[Any, ...] = ()


Effect = Post | Revise | Retract


def kind_of(effect: Effect) -> type[Any]:
    """The class of the value that an effect touches."""
    return type(effect.value if isinstance(effect, Post) else effect.entry.value)
