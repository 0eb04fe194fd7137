"""An act that lacks something asks for it, and comes when it was answered, as if it had been there before."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import (
    Activation,
    Blackboard,
    Change,
    Decision,
    Effect,
    Entry,
    Index,
    Level,
    MissingEntryError,
    Post,
    Posted,
    Ref,
    Revise,
    Role,
    Scheduler,
    View,
    observation,
    request,
)
from blackboard.board import TracedView
from blackboard.kinds import Kind
from blackboard.scheduler import MISSING_RATING
from strategies import Note, Scripted, Tally, levels, notes, ratings, run, tallies

LETTERS = "abcd"


@observation(traced=True)
@dataclass(frozen=True, slots=True)
class Page:
    """What is to be read: the page of a letter."""

    letter: str
    text: str = ""


@request()
@dataclass(frozen=True, slots=True)
class Order:
    """Asks for pages."""

    letters: tuple[str, ...]
    status: str = "asked"


PAGE_OF: Index[Page] = Index(Page, lambda page: page.letter)
BY_TEXT: Index[Page] = Index(Page, lambda page: page.text or None)
ON_SHELVES = {letter: Page(letter, letter.upper()) for letter in LETTERS}


class Library:
    """The port that has the pages."""

    name = "library"

    def __init__(self, shelves: Mapping[str, Page] = ON_SHELVES) -> None:
        self._shelves = shelves

    def answer(self, change: Change) -> Iterable[Effect]:
        order = change.entry
        if isinstance(change, Posted) and isinstance(order.value, Order):
            found = [self._shelves[letter] for letter in order.value.letters if letter in self._shelves]
            if found:
                yield from (Post(page, (order,)) for page in found)
                yield Revise(order, replace(order.value, status="answered"), (order,))


def read(view: View, letters: str, *, one_by_one: bool = False) -> list[Entry[Page]]:
    """The pages of these letters; asks for those that are not there, all at once or the first."""
    pages = {letter: view.newest(PAGE_OF, letter) for letter in letters}
    missing = tuple(letter for letter, page in pages.items() if page is None)
    if missing:
        raise MissingEntryError(Order(missing[:1] if one_by_one else missing))
    return [page for page in pages.values() if page is not None]


@dataclass(frozen=True, slots=True)
class Reader:
    """A knowledge source that reads pages for each note: its own and those of the note's letters."""

    letters: str
    rating: float
    level: Level
    revises: bool
    one_by_one: bool

    def source(self, number: int) -> Scripted:
        def act(view: View, trigger: Change) -> Iterable[Effect]:
            note = trigger.entry
            pages = read(view, self.letters + note.value.text, one_by_one=self.one_by_one)
            if self.revises:
                yield Revise(note, Note("".join(page.value.text for page in pages)), (note, *pages))
            else:
                yield Post(Tally(len(pages)), (note, *pages))

        return Scripted(f"reader_{number}", Note, act, rate=self.rating, level=self.level, kinds=(Posted,),
                        writes=(Note, Tally, Order))


letters = st.text(LETTERS, max_size=3)
readers = st.lists(st.builds(Reader, letters, ratings, levels, st.booleans(), st.booleans()), min_size=1, max_size=4)


def read_notes(
    team: list[Reader], texts: list[str], there: str, retention: Mapping[type[object], Kind] | None = None
) -> list[Decision]:
    """Every decision; pages of the letters ``there`` are on the board before the first note."""
    scheduler = Scheduler([reader.source(number) for number, reader in enumerate(team)], ports=[Library()],
                          kinds=(Page,), retention=retention)
    scheduler.post([Post(ON_SHELVES[letter]) for letter in there], "library")
    decisions = run(scheduler)
    for text in texts:
        scheduler.post([Post(Note(text))], "user")
        decisions += run(scheduler)
    return decisions


def is_wait(decision: Decision) -> bool:
    return any(isinstance(change.entry.value, Order) for change in decision.made)


def by_place(activation: Activation | None) -> object:
    """An activation by all but its cycle."""
    return activation and (activation.number, activation.source.name, activation.trigger.entry.ref, activation.rating)


def told(decision: Decision) -> object:
    """What a decision did, and with whom in which place; pages by their letter, for they may have come later."""
    made = [(change.entry.id, change.entry.revision, change.entry.value, reasons(change)) for change in decision.made]
    return (by_place(decision.chosen), by_place(decision.runner_up), decision.focus, decision.pending, decision.refused,
            [(by_place(o.activation), o.reason) for o in decision.obviated], made)


def reasons(change: Change) -> list[str]:
    return [str(reason) for reason in change.entry.because if not reason.id.startswith("Page")]


@settings(deadline=None, max_examples=100)
@given(team=readers, texts=st.lists(letters, max_size=3), there=st.sets(st.sampled_from(LETTERS)))
def test_its_effects_and_its_place_are_what_they_would_have_been_had_everything_been_there(
    team: list[Reader], texts: list[str], there: set[str]
) -> None:
    known = [told(d) for d in read_notes(team, texts, LETTERS) if d.chosen or d.obviated]
    asked = read_notes(team, texts, "".join(sorted(there)))
    assert [told(d) for d in asked if (d.chosen or d.obviated) and not is_wait(d)] == known


@settings(deadline=None, max_examples=100)
@given(team=readers, texts=st.lists(letters, max_size=3), there=st.sets(st.sampled_from(LETTERS)))
def test_it_asks_once_and_comes_in_the_next_cycle(team: list[Reader], texts: list[str], there: set[str]) -> None:
    decisions = read_notes(team, texts, "".join(sorted(there)))
    ordered: list[str] = []
    for decision, after in pairwise(decisions):
        if is_wait(decision):
            (change,) = decision.made
            assert isinstance(change, Posted) and decision.chosen is not None
            assert change.entry.author == decision.chosen.source.name
            assert change.entry.because == (decision.chosen.trigger.entry.ref,)
            assert after.chosen is not None and by_place(after.chosen) == by_place(decision.chosen)
            assert {type(c.entry.value) for c in after.observed} == {Page, Order}
            ordered += change.entry.value.letters
    assert sorted({*ordered, *there}) == sorted([*ordered, *there])  # nothing that was there, and nothing twice


@settings(deadline=None, max_examples=100)
@given(team=readers, texts=st.lists(letters, min_size=1, max_size=4))
def test_nothing_leaves_memory_while_an_act_waits_and_then_it_does(team: list[Reader], texts: list[str]) -> None:
    """So also an act that reads more pages than stay finds them together in the end."""
    retention = {Page: Kind(Role.OBSERVATION, keep=1, traced=True)}
    decisions = read_notes(team, [*texts, "a", "b", "c"], "", retention)
    on_board, was_wait = 0, False
    for decision in decisions:
        assert "nobody" not in decision.refused and "raised" not in decision.refused
        on_board += sum(isinstance(c.entry.value, Page) for c in decision.observed) - len(decision.left)
        assert not (was_wait and decision.left)
        was_wait = is_wait(decision)
        if not was_wait and decision.chosen is not None:
            assert on_board >= len(decision.used)
    assert on_board <= len(LETTERS)


@settings(deadline=None, max_examples=100)
@given(team=readers, texts=st.lists(letters, max_size=6), keep=st.integers(1, 3))
def test_decisions_are_the_same_with_retention_and_without_but_for_what_is_asked_again(
    team: list[Reader], texts: list[str], keep: int
) -> None:
    without = read_notes(team, texts, "", {})
    with_it = read_notes(team, texts, "", {Page: Kind(Role.OBSERVATION, keep=keep, traced=True)})
    assert [told(d) for d in with_it if not is_wait(d)] == [told(d) for d in without if not is_wait(d)]
    assert sum(map(is_wait, with_it)) >= sum(map(is_wait, without))


def test_what_came_while_an_act_waited_leaves_later_and_comes_back_when_asked_for() -> None:
    retention = {Page: Kind(Role.OBSERVATION, keep=1, traced=True)}
    reader = Reader("", 0.5, Level.PLAN, False, True)
    decisions = read_notes([reader], ["abcd", "", "", "a"], "", retention)
    assert [d.left for d in decisions if is_wait(d)] == [()] * 5
    left = [ref.id for d in decisions for ref in d.left]
    assert left == ["Page-1", "Page-2", "Page-3", "Page-4"]
    assert [d.used for d in decisions if d.chosen][-1] == (Ref("Page-5", 0),)


@given(team=readers, text=letters)
def test_what_nobody_answers_is_not_asked_twice_and_the_act_is_refused(team: list[Reader], text: str) -> None:
    scheduler = Scheduler([reader.source(number) for number, reader in enumerate(team)], ports=[Library({})],
                          kinds=(Page,))
    scheduler.post([Post(Note(text))], "user")
    decisions = run(scheduler)
    orders = [order.value for order in scheduler.view.all(Order)]
    assert len(set(orders)) == len(orders)
    for decision in decisions:
        if decision.refused:
            assert decision.refused.startswith("nobody answered Order-") and decision.made == ()
    lacking = [o for number, reader in enumerate(team) if (o := f"reader_{number}") and reader.letters + text]
    refused = [d.chosen.source.name for d in decisions if d.refused and d.chosen]
    assert len(set(refused)) == len(refused) and set(refused) <= set(lacking)
    if not any(reader.revises for reader in team):  # what was revised lets the others' triggers go stale
        assert sorted(refused) == sorted(lacking)
    assert scheduler.step() is None


def test_a_source_that_may_not_write_the_request_is_refused() -> None:
    def act(view: View, trigger: Change) -> Iterable[Effect]:
        read(view, "a")
        return ()

    scheduler = Scheduler([Scripted("reader", Note, act)], ports=[Library()], kinds=(Page, Order))
    scheduler.post([Post(Note(""))], "user")
    assert [d.refused for d in run(scheduler)] == ["reader may not write Order"]
    assert scheduler.view.all(Order) == () and scheduler.view.all(Page) == ()


@given(others=st.lists(st.floats(0.0, 0.99), max_size=4), then=ratings | st.none())
def test_a_source_that_lacks_something_to_rate_comes_first_and_is_asked_again(
    others: list[float], then: float | None
) -> None:
    """What it says in the end is whether it can act; its place is the one in which it asked."""
    def rate(view: View, trigger: Change) -> float | None:
        read(view, trigger.entry.value.text)
        return then

    def act(view: View, trigger: Change) -> Iterable[Effect]:
        yield Post(Tally(len(read(view, trigger.entry.value.text))), (trigger.entry,))

    unsure = Scripted("unsure", Note, act, rate=rate, writes=(Tally, Order))
    team = [*(Scripted(f"other_{number}", Note, rate=rating) for number, rating in enumerate(others)), unsure]
    scheduler = Scheduler(team, ports=[Library()], kinds=(Page,))
    scheduler.post([Post(Note("ab"))], "user")
    first, *rest = run(scheduler)
    assert first.chosen is not None and first.chosen.source is unsure and first.chosen.rating == MISSING_RATING
    assert is_wait(first) and not any(is_wait(decision) for decision in rest)
    if then is None:
        assert [o.reason for d in rest for o in d.obviated] == ["could not answer any more"]
        assert scheduler.view.all(Tally) == ()
    else:
        assert rest[0].chosen is not None and rest[0].chosen.source is unsure and rest[0].made


@settings(deadline=None, max_examples=100)
@given(st.lists(st.tuples(letters, st.sampled_from(LETTERS)), min_size=1, max_size=6), st.booleans())
def test_a_decision_names_exactly_the_traced_revisions_that_the_act_read(
    steps: list[tuple[str, str]], one_by_one: bool
) -> None:
    """Also where it asked: those that it had read before. Pages are revised in between; notes are read and not traced.
    """
    reader = Reader("", 0.5, Level.PLAN, False, one_by_one)
    scheduler = Scheduler([reader.source(0)], ports=[Library()], kinds=(Page,))
    for text, revised in steps:
        page = scheduler.view.newest(PAGE_OF, revised)
        if page is not None:
            scheduler.post([Revise(page, replace(page.value, text=page.value.text + "!"))], "user")
        scheduler.post([Post(Note(text))], "user")
        while True:
            pages = scheduler.view.all(Page)
            decision = scheduler.step()
            if decision is None:
                break
            wanted = decision.chosen.trigger.entry.value.text if decision.chosen else ""
            assert decision.used == tuple(page.ref for page in pages if page.value.letter in wanted)


# -- traced views ------------------------------------------------------------------------------------------------------


@st.composite
def boards(draw: st.DrawFn) -> Blackboard:
    """Pages, notes and tallies, some of them revised."""
    board = Blackboard()
    pages = st.builds(Page, st.sampled_from(LETTERS), st.text("xy", max_size=2))
    for cycle, value in enumerate(draw(st.lists(pages | notes | tallies, max_size=8))):
        board.apply([Post(value)], author="user", cycle=cycle)
    for page in board.view.all(Page):
        if draw(st.booleans()):
            board.apply([Revise(page, replace(page.value, text="x"))], author="user", cycle=9)
    return board


def readings(kind: type[object], letter: str, text: str, id: str, cycle: int) -> Iterator[Callable[[View], object]]:
    """Every question that a view answers."""
    yield lambda view: view.get(id)
    yield lambda view: view[id] if view.get(id) is not None else None
    yield lambda view: view.all(kind)
    yield lambda view: tuple(view.newest_first(kind))
    yield lambda view: view.latest(kind)
    yield lambda view: view.latest(kind, lambda value: value == Page(letter, text))
    yield lambda view: view.where(kind, lambda value: value == Page(letter, text))
    yield lambda view: view.having(PAGE_OF, letter)
    yield lambda view: view.newest(BY_TEXT, text)
    yield lambda view: view.since(kind, cycle)
    yield lambda view: sorted(map(str, view.keys(PAGE_OF)))
    yield len


def entries_in(answer: object) -> set[Entry[object]]:
    found = answer if isinstance(answer, tuple) and not isinstance(answer, Entry) else (answer,)
    return {entry for entry in found if isinstance(entry, Entry)}


@settings(deadline=None, max_examples=100)
@given(boards(), st.sampled_from((Page, Note, Tally)), st.sampled_from(LETTERS), st.text("xy", max_size=2),
       st.sampled_from(("Page-1", "Page-2", "Note-1")), st.integers(0, 10))
def test_a_traced_view_answers_as_a_view_and_names_what_it_gave(
    board: Blackboard, kind: type[object], letter: str, text: str, id: str, cycle: int
) -> None:
    for ask in readings(kind, letter, text, id, cycle):
        view = TracedView(board, frozenset((Page,)))
        answer = ask(view)
        assert answer == ask(board.view)
        given_out = {entry.ref for entry in entries_in(answer) if isinstance(entry.value, Page)}
        assert given_out <= view.used <= {page.ref for page in board.view.all(Page)}


@given(boards())
def test_a_traced_view_names_no_more_than_was_read(board: Blackboard) -> None:
    """One by one as they are read; what a predicate looked at was read too."""
    pages = board.view.all(Page)
    view = TracedView(board, frozenset((Page,)))
    newest = view.newest_first(Page)
    for number, page in enumerate(reversed(pages)):
        assert view.used == {read.ref for read in pages[len(pages) - number:]}
        assert next(newest) == page
    for asked in (lambda v: v.all(Note), lambda v: v.keys(PAGE_OF), len, lambda v: [v.is_current(p) for p in pages]):
        view = TracedView(board, frozenset((Page,)))
        asked(view)
        assert view.used == set[Ref]()


def test_what_is_not_there_is_a_key_error_as_in_a_view() -> None:
    with pytest.raises(KeyError):
        TracedView(Blackboard(), frozenset())["Page-1"]
