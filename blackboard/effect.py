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


class MissingEntryError(Exception):
    """Raised by an act, or by a rating: what it reads is not on the board yet.

    The scheduler posts the request in the name of the knowledge source, and the act comes when it was answered.

    Attributes:
        request: the value that asks for what is missing: a kind of request.
    """

    def __init__(self, request: Any) -> None:
        super().__init__(f"not on the board yet: {request}")
        self.request = request


def to_say(known: Entry[Any] | None, value: Any | None, because: tuple[Any, ...]) -> Effect | None:
    """What makes the board say ``value`` where it says what ``known`` says, or nothing; None where it does already."""
    if known is None:
        return None if value is None else Post(value, because)
    if value is None:
        return Retract(known, because)
    return None if known.value == value else Revise(known, value, because)


def type_of(effect: Effect) -> type[Any]:
    """The class of the value that an effect touches."""
    return type(effect.value if isinstance(effect, Post) else effect.entry.value)
