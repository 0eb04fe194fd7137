"""The agenda against a plain list that is sorted again for every question."""

from __future__ import annotations

from typing import Any

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from blackboard import Activation, Entry, Ladder, Level, Posted, Revised
from blackboard.agenda import Agenda
from strategies import Note, Scripted, ratings

KNOWLEDGE_SOURCES = [Scripted(f"{level}_{number}", level=level) for level in Level for number in range(2)]
sources = st.sampled_from(KNOWLEDGE_SOURCES)
few_ratings = st.sampled_from((0.0, 0.3, 0.5, 1.0)) | ratings


class AgendaMachine(RuleBasedStateMachine):
    """Random bids on a few entries; ``model`` is every pending activation, in no order."""

    def __init__(self) -> None:
        super().__init__()
        self.agenda = Agenda()
        self.model: list[Activation] = []
        self.number = 0

    @rule(source=sources, id=st.integers(0, 6), revision=st.integers(0, 2), rating=few_ratings)
    def add(self, source: Any, id: int, revision: int, rating: float) -> None:
        self.number += 1
        entry = Entry(f"Note-{id}", revision, Note("a"), "user", 0)
        activation = Activation(self.number, source, (Revised if revision else Posted)(entry), rating, 1)
        if any(a.source is source and a.trigger.entry.id == entry.id for a in self.model):
            return  # the scheduler drops what is stale before it adds
        self.agenda.add(activation)
        self.model.append(activation)

    @precondition(lambda self: self.model)
    @rule(focus=st.sampled_from(Level))
    def take_the_best(self, focus: Level) -> None:
        best = self.agenda.best(Ladder(Level).nearest(focus))
        assert best is not None
        self.agenda.take(best)
        self.model.remove(best)

    @precondition(lambda self: self.model)
    @rule(pick=st.integers(0, 20))
    def drop_any(self, pick: int) -> None:
        dropped = self.model.pop(pick % len(self.model))
        self.agenda.take(dropped)

    @precondition(lambda self: self.model)
    @rule(pick=st.integers(0, 20))
    def take_and_put_back(self, pick: int) -> None:
        """As the scheduler does with the chosen one when the next best raises."""
        activation = self.model[pick % len(self.model)]
        self.agenda.take(activation)
        self.agenda.add(activation)

    @invariant()
    def the_best_is_what_sorting_finds(self) -> None:
        """Nearest level, then best rated, then oldest (§2, Figure 2)."""
        for focus in Level:
            ranked = sorted(self.model, key=lambda a: (abs(a.source.level - focus), -a.rating, a.number))
            assert self.agenda.best(Ladder(Level).nearest(focus)) is (ranked[0] if ranked else None)

    @invariant()
    def nothing_is_lost_and_what_triggered_it_is_known(self) -> None:
        assert list(self.agenda) == sorted(self.model, key=lambda a: a.number)
        assert len(self.agenda) == len(self.model)
        for id in range(7):
            expected = sorted((a for a in self.model if a.trigger.entry.id == f"Note-{id}"), key=lambda a: a.number)
            assert list(self.agenda.triggered_by(f"Note-{id}")) == expected


TestAgenda = AgendaMachine.TestCase
TestAgenda.settings = settings(max_examples=30, stateful_step_count=40, deadline=None)
