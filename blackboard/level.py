"""Level: an ordered enum of the levels at which knowledge sources work, lowest first."""

from __future__ import annotations

from enum import IntEnum
from functools import cache


class Level(IntEnum):
    """The three levels of perceptual servoing (§2, Figure 2). Another system may have levels of its own, an IntEnum."""

    ACTION = 0
    PLAN = 1
    GOAL = 2

    @property
    def above(self) -> Level:
        """Raises ValueError at the top."""
        return Level(self + 1)

    def __str__(self) -> str:
        return word_of(self)


class Flat(IntEnum):
    """The one level of a program that has no levels; no journal tells of it."""

    ONLY = 0


def word_of(level: IntEnum) -> str:
    """A level in words."""
    return _words(type(level))[level]


@cache
def _words(levels: type[IntEnum]) -> dict[int, str]:
    return {int(level): level.name.lower() for level in levels}


@cache
def highest(levels: type[IntEnum]) -> IntEnum:
    """The highest level of an enum of levels."""
    return max(levels)
