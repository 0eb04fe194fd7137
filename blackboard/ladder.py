"""The levels at which knowledge sources work, and the ladder of them: which is in focus, and the choice rule."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from itertools import groupby
from typing import Any

from blackboard.board import View
from blackboard.entry_store import Index


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


Groups = tuple[tuple[IntEnum, ...], ...]
"""Levels, those together that are equally near."""


@cache
def _nearest(levels: type[IntEnum], focus: int) -> Groups:
    """All levels in groups, nearest to the focus first. Levels of two enums may be equal numbers: both are the key."""
    near = sorted(levels, key=lambda level: abs(level - focus))
    return tuple(tuple(group) for _, group in groupby(near, key=lambda level: abs(level - focus)))


@dataclass(frozen=True, slots=True)
class Ladder:
    """Which levels there are, which are switched on, and how the next activation is chosen.

    Attributes:
        levels: an ordered enum, lowest first.
        open: files what is in doubt by its level; the highest level of these is in focus. None: always the lowest.
        off: the levels whose loops are not closed.
    """

    levels: type[IntEnum]
    open: Index[Any] | None = None
    off: frozenset[IntEnum] = frozenset()

    @staticmethod
    def of(levels: Iterable[IntEnum]) -> Ladder:
        """The one that some levels stand on; where all are the lowest of a default, none is needed."""
        highest = max(levels, default=Flat.ONLY)
        return Ladder(type(highest) if highest else Flat)

    def allows(self, closes: IntEnum | None) -> bool:
        """Whether a knowledge source that closes this loop may be activated."""
        return closes not in self.off

    def focus(self, view: View) -> IntEnum:
        """The highest level on which something is open; the lowest where nothing is."""
        found: Collection[Any] = () if self.open is None else view.keys(self.open)
        return max(found) if found else min(self.levels)

    def nearest(self, focus: IntEnum) -> Groups:
        """The levels, nearest to the focus first; two that are equally near stand together. Pure.

        This is the choice rule: the best rated activation of the nearest level that has any is executed, and of equally
        rated ones the oldest.
        """
        return _nearest(self.levels, focus)
