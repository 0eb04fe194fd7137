"""Level: the three levels of perceptual servoing (§2, Figure 2)."""

from __future__ import annotations

from enum import IntEnum


class Level(IntEnum):
    """The three levels of perceptual servoing."""

    ACTION = 0
    PLAN = 1
    GOAL = 2

    @property
    def above(self) -> Level:
        """Raises ValueError at the top."""
        return Level(self + 1)

    def __str__(self) -> str:
        return WORDS[self]


WORDS = tuple(level.name.lower() for level in Level)
