"""Forgetting: the same decisions with it and without, to the byte; a board that stays small; nothing lost for good."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import (
    Change,
    Decision,
    Effect,
    Index,
    Level,
    Post,
    Posted,
    Ref,
    Retract,
    Retracted,
    Revise,
    Revised,
    Role,
    Scheduler,
    View,
    decision_line,
)
from blackboard.journal import entry_record
from blackboard.kinds import Kind
from logs.journal_file import JournalFile
from logs.timeline import Timeline
from strategies import Note, Scripted, Tally, levels, ratings, run
from world_models.entries import LADDER

MOST_CYCLES = 40
SMALL: Index[Tally] = Index(Tally, lambda tally: tally.count % 3)
def keeping(newest: int, **more: Any) -> Kind:
    """Retention that keeps the newest, so many."""
    return Kind(Role.INFERENCE, keep=newest, **more)


Rule = tuple[type[Any], str, float, Level]

rules = st.lists(
    st.tuples(
        st.sampled_from((Note, Tally)), st.sampled_from(("post", "revise", "retract", "both")), ratings, levels
    ),
    min_size=1, max_size=5,
)
keeps = st.integers(1, 4)


def source_of(number: int, rule: Rule) -> Scripted:
    """It asks for the newest of each kind and for its trigger: what the rules below keep."""
    on, what, rating, level = rule

    def rate(view: View, trigger: Change) -> float | None:
        newest = view.latest(Tally)
        return None if newest is not None and newest.value.count % 7 == number else rating

    def act(view: View, trigger: Change) -> Iterable[Effect]:
        note, tally = view.latest(Note), view.latest(Tally)
        count = 0 if tally is None else tally.value.count
        if what in ("post", "both"):
            yield Post(Tally(count + 1), (trigger.entry,))
        if what in ("revise", "both") and note is not None and not isinstance(trigger, Retracted):
            yield Revise(note, Note(f"{len(note.value.text) % 5 * 'x'}{count % 3}"), (trigger.entry,))
        if what == "retract" and tally is not None:
            yield Retract(tally, (trigger.entry,))
            yield Post(Tally(count + 2), (tally,))

    return Scripted(f"e{number}", on, act, rate=rate, level=level, kinds=(Posted, Revised, Retracted))


def run_board(program: list[Rule], retention: Mapping[type[Any], Kind]) -> tuple[list[str], Scheduler]:
    lines: list[str] = []
    scheduler = Scheduler(
        [source_of(i, rule) for i, rule in enumerate(program)], retention=retention,
        sinks=[lambda d: lines.append(decision_line(d))],
    )
    for text in "abc":
        scheduler.post([Post(Note(text)), Post(Tally(len(text)))], "user")
        run(scheduler, MOST_CYCLES // 3)
    return lines, scheduler


@settings(deadline=None, max_examples=60)
@given(program=rules, notes_kept=keeps, tallies_kept=keeps)
def test_decisions_are_the_same_with_it_and_without(program: list[Rule], notes_kept: int, tallies_kept: int) -> None:
    """The newest are kept, so a source that asks for the newest, or was triggered, finds what it found without."""
    without, all_of_it = run_board(program, {})
    lines, rest = run_board(program, {Note: keeping(notes_kept), Tally: keeping(tallies_kept)})
    assert lines == without
    assert len(rest.view) <= len(all_of_it.view)


@settings(deadline=None, max_examples=40)
@given(program=rules, notes_kept=keeps, tallies_kept=keeps)
def test_a_decision_tells_what_left_memory_and_the_journal_does_not(
    program: list[Rule], notes_kept: int, tallies_kept: int
) -> None:
    """Following the changes of each decision and what left gives the board, revision by revision."""
    on_board: dict[str, Ref] = {}
    decisions: list[Decision] = []

    def follow(decision: Decision) -> None:
        decisions.append(decision)
        for change in decision.observed:
            _follow(on_board, change)
        for ref in decision.left:
            assert on_board.pop(ref.id) == ref
        for change in decision.made:
            _follow(on_board, change)

    scheduler = Scheduler(
        [source_of(i, rule) for i, rule in enumerate(program)], sinks=[follow],
        retention={Note: keeping(notes_kept), Tally: keeping(tallies_kept)},
    )
    for text in "abc":
        scheduler.post([Post(Note(text)), Post(Tally(len(text)))], "user")
        run(scheduler, MOST_CYCLES // 3)
        assert set(on_board.values()) == {entry.ref for kind in (Note, Tally) for entry in scheduler.view.all(kind)}
    assert all(decision_line(d) == decision_line(d._replace(left=())) for d in decisions)


def _follow(on_board: dict[str, Ref], change: Change) -> None:
    if isinstance(change, Retracted):
        on_board.pop(change.entry.id, None)
    else:
        on_board[change.entry.id] = change.entry.ref


def chatter(retention: Mapping[type[Any], Kind], cycles: int, *, patient: bool = False) -> Scheduler:
    """A source that answers each tally with the next, and perhaps one that is never chosen and waits for notes."""
    def count_on(view: View, trigger: Change) -> Iterable[Effect]:
        yield Post(Tally(trigger.entry.value.count + 1), (trigger.entry,))

    sources = [Scripted("counter", Tally, count_on, rate=0.9)]
    if patient:
        sources.append(Scripted("patient", Note, rate=0.1))
    scheduler = Scheduler(sources, retention=retention)
    scheduler.post([Post(Note("waits")), Post(Tally(0))], "user")
    run(scheduler, cycles)
    return scheduler


@pytest.mark.parametrize("keep", [1, 2, 5])
def test_the_newest_stay_and_the_board_stays_small(keep: int) -> None:
    scheduler = chatter({Tally: keeping(keep)}, 300)
    newest = [entry.value.count for entry in scheduler.view.all(Tally)]
    assert newest == list(range(newest[-1] - len(newest) + 1, newest[-1] + 1))
    assert keep <= len(newest) <= keep + 2 and newest[-1] == 300


def test_what_a_rule_spares_stays_as_long_as_it_does() -> None:
    spare = keeping(1, when=lambda tally: tally.count % 10 != 3, unless=lambda view, e: e.value.count == 25)
    counts = [entry.value.count for entry in chatter({Tally: spare}, 60).view.all(Tally)]
    assert [c for c in counts if c < 50] == [3, 13, 23, 25, 33, 43]


def test_what_a_pending_activation_was_triggered_by_stays() -> None:
    def post_notes(view: View, trigger: Change) -> Iterable[Effect]:
        if trigger.entry.value.count < 20:
            yield Post(Tally(trigger.entry.value.count + 1), (trigger.entry,))
            yield Post(Note("more"), (trigger.entry,))

    patient = Scripted("patient", Note, rate=0.1)
    scheduler = Scheduler([Scripted("counter", Tally, post_notes, rate=0.9), patient], retention={Note: keeping(1)})
    scheduler.post([Post(Tally(0))], "user")
    decisions = run(scheduler, 100)
    assert [d.chosen.source.name for d in decisions if d.chosen].count("patient") == 20
    assert not any(o.activation.source is patient for d in decisions for o in d.obviated)
    scheduler.post([Post(Note("last")), Post(Note("very last"))], "user")
    run(scheduler, 10)
    assert len(scheduler.view.all(Note)) < 20


def test_what_another_entry_needs_stays_as_long_as_that_one() -> None:
    """Each note of an even tally needs that tally; notes stay, so tallies with a note do."""
    def count_on(view: View, trigger: Change) -> Iterable[Effect]:
        tally = trigger.entry
        if tally.value.count < 20:
            yield Post(Tally(tally.value.count + 1), (tally,))
            if tally.value.count % 4 == 0:
                yield Post(Note(tally.id), (tally,))

    needing = Kind(Role.INFERENCE, needs=lambda note: (note.text,))
    scheduler = Scheduler([Scripted("counter", Tally, count_on)], retention={Tally: keeping(1), Note: needing})
    scheduler.post([Post(Tally(0))], "user")
    run(scheduler)
    counts = [entry.value.count for entry in scheduler.view.all(Tally)]
    assert counts[:5] == [0, 4, 8, 12, 16] and len(counts) < 12


def test_an_index_follows_what_is_forgotten() -> None:
    scheduler = chatter({Tally: keeping(3)}, 50)
    view = scheduler.view
    for key in range(3):
        assert view.having(SMALL, key) == tuple(e for e in view.all(Tally) if e.value.count % 3 == key)


@settings(deadline=None, max_examples=25)
@given(program=rules)
def test_every_revision_can_be_read_back_from_the_journal(program: list[Rule]) -> None:
    """Those that left memory, were revised or retracted too."""
    written: dict[str, Any] = {}
    with TemporaryDirectory() as folder:
        path = Path(folder) / "journal.jsonl"
        journal = JournalFile(path)

        def remember(decision: Any) -> None:
            for change in (*decision.observed, *decision.made):
                if not isinstance(change, Retracted):
                    written[str(change.entry.ref)] = entry_record(change.entry)["value"]

        scheduler = Scheduler([source_of(i, r) for i, r in enumerate(program)], sinks=[journal, remember],
                              retention={Note: keeping(1), Tally: keeping(1)}, ladder=LADDER)
        scheduler.post([Post(Note("a")), Post(Tally(1))], "user")
        run(scheduler, 24)
        journal.close()
        history = Timeline(path)
        assert {ref: history.entry(ref).fields for ref in written} == written
