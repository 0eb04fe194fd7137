"""Mirror: the board as the changes tell of it, for all who follow a run while it goes on."""

from __future__ import annotations

from blackboard import Blackboard, Change, Entry, Retracted, View
from world_models.entries.location import Hypothesis

KEPT = 64
"""So many entries of a type are remembered, the newest: nothing older is asked for, and a long run does not grow."""


class Mirror(View):
    """A view of the newest entries of each type."""

    def __init__(self, kept: int = KEPT) -> None:
        super().__init__(Blackboard())
        self._kept = kept

    def take(self, *changes: Change) -> None:
        """Follow some changes."""
        for change in changes:
            self._board.follow(change)
            if not isinstance(change, Retracted) and len(same := self.all(type(change.entry.value))) > self._kept:
                self._board.forget(same[0].id)


def find_belief(board: View) -> Entry[Hypothesis] | None:
    """The hypothesis that is acted on."""
    return board.latest(Hypothesis, lambda value: value.is_held)
