"""The blackboard against a dict that knows nothing of revisions, indexes, effects or forgetting."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from blackboard import (
    Blackboard,
    Effect,
    Entry,
    Index,
    Post,
    Posted,
    Ref,
    Retract,
    Retracted,
    Revise,
    Revised,
    StaleError,
    to_say,
)
from strategies import Note, Tally, notes, tallies, values

picks = st.integers(0, 30)
kinds = st.sampled_from((Note, Tally))
EVEN: Index[Tally] = Index(Tally, lambda tally: tally.count % 2 == 0)
BY_COUNT: Index[Tally] = Index(Tally, lambda tally: tally.count)
SHORT: Index[Note] = Index(Note, lambda note: note.text if len(note.text) < 2 else None)
Wish = tuple[str, type[Any], int, int, int]
wishes = st.lists(
    st.tuples(st.sampled_from(("post", "revise", "retract")), kinds, st.integers(0, 9), picks, picks),
    min_size=1, max_size=4,
)


def made_of(kind: type[Any], number: int) -> Any:
    return kind(number) if kind is Tally else kind(str(number))


class BoardMachine(RuleBasedStateMachine):
    """Random acts; ``model`` maps the ids of what is believed to (revision, value), in order of posting."""

    def __init__(self) -> None:
        super().__init__()
        self.board = Blackboard()
        self.model: dict[str, tuple[int, Any]] = {}
        self.written: dict[str, int] = {}
        self.seen: list[Entry[Any]] = []
        self.posted = {Note: 0, Tally: 0}
        self.cycle = 0

    def effect(self, wish: Wish, entries: list[Entry[Any]], earlier: list[Effect]) -> Effect:
        what, kind, number, pick, reason = wish
        reasons: list[Any] = [*self.seen, *earlier]
        because = (reasons[reason % len(reasons)],) if reasons else ()
        if what == "post" or not entries:
            return Post(made_of(kind, number), because)
        entry = entries[pick % len(entries)]
        if what == "retract":
            return Retract(entry, because)
        return Revise(entry, made_of(type(entry.value), number), because)

    def is_stale(self, effects: list[Effect]) -> bool:
        touched = [e.entry for e in effects if not isinstance(e, Post)]
        old = any(self.model.get(entry.id, (None,))[0] != entry.revision for entry in touched)
        return old or len({entry.id for entry in touched}) < len(touched)

    def foresee(self, effect: Effect) -> tuple[type[Any], str, int, Any]:
        """What change the model makes of it: kind, id, revision, value."""
        if isinstance(effect, Post):
            self.posted[type(effect.value)] += 1
            id = f"{type(effect.value).__name__}-{self.posted[type(effect.value)]}"
            self.model[id] = (0, effect.value)
            return Posted, id, 0, effect.value
        id, revision = effect.entry.id, effect.entry.revision
        if isinstance(effect, Retract):
            del self.model[id]
            return Retracted, id, revision, effect.entry.value
        self.model[id] = (revision + 1, effect.value)
        return Revised, id, revision + 1, effect.value

    def carry_out(self, effects: list[Effect]) -> None:
        self.cycle += 1
        if self.is_stale(effects):
            with pytest.raises(StaleError):
                self.board.apply(effects, author="a", cycle=self.cycle)
            return
        changes = self.board.apply(effects, author="a", cycle=self.cycle)
        expected = [self.foresee(e) for e in effects]
        assert [(type(c), c.entry.id, c.entry.revision, c.entry.value) for c in changes] == expected
        made = {id(effect): change.entry.ref for effect, change in zip(effects, changes, strict=True)}
        for effect, change in zip(effects, changes, strict=True):
            if isinstance(change, Retracted):
                assert change.because == tuple(made.get(id(r)) or r.ref for r in effect.because)
                del self.written[change.entry.id]
            else:
                self.written.pop(change.entry.id, None)
                self.written[change.entry.id] = self.cycle
                assert (change.entry.author, change.entry.cycle) == ("a", self.cycle)
                assert change.entry.because == tuple(made.get(id(r)) or r.ref for r in effect.because)
                self.seen.append(change.entry)

    @rule(wished=wishes)
    def act_on_what_is_believed(self, wished: list[Wish]) -> None:
        believed = [entry for kind in (Note, Tally) for entry in self.board.view.all(kind)]
        effects: list[Effect] = []
        for wish in wished:
            effects.append(self.effect(wish, believed, effects))
        self.carry_out(effects)

    @rule(wished=wishes)
    def act_on_what_was_ever_seen(self, wished: list[Wish]) -> None:
        effects: list[Effect] = []
        for wish in wished:
            effects.append(self.effect(wish, self.seen, effects))
        self.carry_out(effects)

    @precondition(lambda self: self.model)
    @rule(pick=picks)
    def forget(self, pick: int) -> None:
        """As if it had never been there, but that its name is used up."""
        id = sorted(self.model)[pick % len(self.model)]
        self.board.forget(id)
        del self.model[id]
        del self.written[id]

    @precondition(lambda self: self.model)
    @rule(value=notes, count=tallies, pick=picks)
    def change_the_type_of_an_entry(self, value: Note, count: Tally, pick: int) -> None:
        id = sorted(self.model)[pick % len(self.model)]
        entry = self.board.view.get(id)
        other = count if isinstance(entry.value, Note) else value
        with pytest.raises(ValueError, match="to stay a"):
            self.board.apply([Post(value), Revise(entry, other)], author="a", cycle=self.cycle)

    @rule(value=values)
    def give_a_reason_that_is_none(self, value: Any) -> None:
        with pytest.raises(ValueError, match="expected because to hold entries"):
            self.board.apply([Post(value), Post(value, ("a feeling",))], author="a", cycle=self.cycle)

    @rule(value=values)
    def rest_on_a_later_effect(self, value: Any) -> None:
        later = Post(value)
        with pytest.raises(ValueError, match="earlier effects of the same act"):
            self.board.apply([Post(value, (later,)), later], author="a", cycle=self.cycle)

    @invariant()
    def every_entry_is_as_the_model_says(self) -> None:
        view = self.board.view
        assert len(view) == len(self.model)
        for entry in self.seen:
            now = view.get(entry.id)
            assert (now and (now.revision, now.value)) == self.model.get(entry.id)
            assert view.is_current(entry) == (now is not None and now.revision == entry.revision)

    @invariant()
    def indexes_by_type_are_in_order_of_posting(self) -> None:
        view = self.board.view
        for kind in (Note, Tally):
            ids = [id for id, (_, value) in self.model.items() if isinstance(value, kind)]
            assert [e.id for e in view.all(kind)] == ids
            assert [e.id for e in view.newest_first(kind)] == ids[::-1]
            newest = view.latest(kind)
            assert (newest and newest.id) == (ids[-1] if ids else None)
        even = [id for id, (_, v) in self.model.items() if isinstance(v, Tally) and v.count % 2 == 0]
        assert [e.id for e in view.where(Tally, lambda t: t.count % 2 == 0)] == even
        found = view.latest(Tally, lambda t: t.count % 2 == 0)
        assert (found and found.id) == (even[-1] if even else None)

    def current(self, kind: type[Any]) -> list[tuple[str, Any]]:
        return [(id, value) for id, (_, value) in self.model.items() if isinstance(value, kind)]

    @invariant()
    def indexes_by_key_find_what_going_through_all_finds(self) -> None:
        self.finds(EVEN, [True, False])
        self.finds(BY_COUNT, range(10))

    @precondition(lambda self: self.cycle > 5)
    @invariant()
    def an_index_that_is_asked_for_late_finds_the_same(self) -> None:
        self.finds(SHORT, ["", *"0123456789"])

    def finds(self, index: Index[Any], keys: Any) -> None:
        view = self.board.view
        for key in keys:
            expected = [id for id, value in self.current(index.kind) if index.key(value) == key]
            assert [e.id for e in view.having(index, key)] == expected
            newest = view.newest(index, key)
            assert (newest and newest.id) == (expected[-1] if expected else None)
            assert all(view.is_current(entry) for entry in view.having(index, key))

    @invariant()
    def what_was_written_since_a_cycle_is_in_the_order_in_which_it_was(self) -> None:
        for kind in (Note, Tally):
            ids = {id for id, _ in self.current(kind)}
            for cycle in range(max(0, self.cycle - 3), self.cycle + 2):
                since = [id for id, written in self.written.items() if id in ids and written >= cycle]
                assert [e.id for e in self.board.view.since(kind, cycle)] == since


TestBoard = BoardMachine.TestCase
TestBoard.settings = settings(max_examples=40, stateful_step_count=20, deadline=None)


def test_a_reason_that_is_named_twice_counts_once() -> None:
    board = Blackboard()
    first = Post(Note("a"))
    one, two = board.apply([first, Post(Note("b"), (first, first))], author="x", cycle=1)
    assert two.entry.because == (one.entry.ref,) == (Ref("Note-1", 0),)


def test_an_entry_that_was_retracted_never_comes_back_under_its_name() -> None:
    board = Blackboard()
    (posted,) = board.apply([Post(Note("a"))], author="x", cycle=1)
    board.apply([Retract(posted.entry)], author="x", cycle=2)
    (again,) = board.apply([Post(Note("a"))], author="x", cycle=3)
    assert again.entry.id == "Note-2"
    with pytest.raises(StaleError, match=r"Note-1\.0 is retracted"):
        board.apply([Revise(posted.entry, Note("b"))], author="x", cycle=4)


@given(st.one_of(st.none(), st.text(max_size=3)), st.one_of(st.none(), st.text(max_size=3)))
def test_what_is_to_be_said_is_said_and_nothing_changes_where_it_was(before: str | None, after: str | None) -> None:
    board = Blackboard()
    if before is not None:
        board.apply([Post(Note(before))], author="x", cycle=1)
    known = board.view.latest(Note)
    change = to_say(known, None if after is None else Note(after), ())
    made = () if change is None else board.apply([change], author="x", cycle=2)
    now = board.view.latest(Note)
    assert (None if now is None else now.value) == (None if after is None else Note(after))
    assert (made == ()) is (before == after)
    assert len(board.view) == (0 if after is None else 1)
