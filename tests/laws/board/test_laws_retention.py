"""Forgetting: the same decisions with it and without, to the byte; a board that stays small; nothing lost for good."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard.archive import Archive, ArchiveError
from blackboard.board import View
from blackboard.change import Change, Posted, Retracted, Revised
from blackboard.effect import Effect, Post, Retract, Revise
from blackboard.index import Index
from blackboard.journal import JournalLines, decision_line, entry_record
from blackboard.level import Level
from blackboard.retention import Forget
from blackboard.scheduler import Scheduler
from logs.journal_file import JournalFile
from strategies import Note, Scripted, Tally, levels, ratings, run

MOST_CYCLES = 40
SMALL: Index[Tally] = Index(Tally, lambda tally: tally.count % 3)
Rule = tuple[type[Any], str, float, Level]

rules = st.lists(
    st.tuples(
        st.sampled_from((Note, Tally)), st.sampled_from(("post", "revise", "retract", "both")), ratings, levels
    ),
    min_size=1, max_size=5,
)
keeps = st.integers(1, 4)


def expert_of(number: int, rule: Rule) -> Scripted:
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


def told_again(program: list[Rule], retention: list[Forget[Any]]) -> tuple[list[str], Scheduler]:
    lines: list[str] = []
    scheduler = Scheduler(
        [expert_of(i, rule) for i, rule in enumerate(program)], retention=retention,
        sinks=[lambda d: lines.append(decision_line(d))],
    )
    for text in "abc":
        scheduler.tell([Post(Note(text)), Post(Tally(len(text)))], "user")
        run(scheduler, MOST_CYCLES // 3)
    return lines, scheduler


@settings(deadline=None, max_examples=60)
@given(program=rules, notes_kept=keeps, tallies_kept=keeps)
def test_decisions_are_the_same_with_it_and_without(program: list[Rule], notes_kept: int, tallies_kept: int) -> None:
    """The newest are kept, so whoever asks for the newest, or was triggered, finds what it found without."""
    without, all_of_it = told_again(program, [])
    lines, rest = told_again(program, [Forget(Note, keep=notes_kept), Forget(Tally, keep=tallies_kept)])
    assert lines == without
    assert len(rest.view) <= len(all_of_it.view)


def chatter(retention: list[Forget[Any]], cycles: int, *, patient: bool = False) -> Scheduler:
    """An expert that answers each tally with the next, and perhaps one that is never chosen and waits for notes."""
    def count_on(view: View, trigger: Change) -> Iterable[Effect]:
        yield Post(Tally(trigger.entry.value.count + 1), (trigger.entry,))

    sources = [Scripted("counter", Tally, count_on, rate=0.9)]
    if patient:
        sources.append(Scripted("patient", Note, rate=0.1))
    scheduler = Scheduler(sources, retention=retention)
    scheduler.tell([Post(Note("waits")), Post(Tally(0))], "user")
    run(scheduler, cycles)
    return scheduler


@pytest.mark.parametrize("keep", [1, 2, 5])
def test_the_newest_stay_and_the_board_stays_small(keep: int) -> None:
    scheduler = chatter([Forget(Tally, keep=keep)], 300)
    newest = [entry.value.count for entry in scheduler.view.all(Tally)]
    assert newest == list(range(newest[-1] - len(newest) + 1, newest[-1] + 1))
    assert keep <= len(newest) <= keep + 2 and newest[-1] == 300


def test_what_a_rule_spares_stays_as_long_as_it_does() -> None:
    spare = Forget(Tally, keep=1, when=lambda tally: tally.count % 10 != 3, unless=lambda view, e: e.value.count == 25)
    counts = [entry.value.count for entry in chatter([spare], 60).view.all(Tally)]
    assert [c for c in counts if c < 50] == [3, 13, 23, 25, 33, 43]


def test_what_a_pending_activation_was_triggered_by_stays() -> None:
    def post_notes(view: View, trigger: Change) -> Iterable[Effect]:
        if trigger.entry.value.count < 20:
            yield Post(Tally(trigger.entry.value.count + 1), (trigger.entry,))
            yield Post(Note("more"), (trigger.entry,))

    patient = Scripted("patient", Note, rate=0.1)
    scheduler = Scheduler([Scripted("counter", Tally, post_notes, rate=0.9), patient], retention=[Forget(Note, keep=1)])
    scheduler.tell([Post(Tally(0))], "user")
    decisions = run(scheduler, 100)
    assert [d.chosen.source.name for d in decisions if d.chosen].count("patient") == 20
    assert not any(o.activation.source is patient for d in decisions for o in d.obviated)
    scheduler.tell([Post(Note("last")), Post(Note("very last"))], "user")
    run(scheduler, 10)
    assert len(scheduler.view.all(Note)) < 20


def test_two_rules_for_one_type_are_refused() -> None:
    with pytest.raises(ValueError, match="one rule for each type"):
        Scheduler([], retention=[Forget(Tally), Forget(Tally, keep=3)])


def test_an_index_follows_what_is_forgotten() -> None:
    scheduler = chatter([Forget(Tally, keep=3)], 50)
    view = scheduler.view
    for key in range(3):
        assert view.having(SMALL, key) == tuple(e for e in view.all(Tally) if e.value.count % 3 == key)


@settings(deadline=None, max_examples=25)
@given(program=rules)
def test_every_revision_can_be_read_back_from_the_archive(program: list[Rule]) -> None:
    """Those that were forgotten, revised or retracted too; while the journal is being written, and by a second one."""
    told: dict[str, Any] = {}
    with TemporaryDirectory() as folder:
        journal = JournalFile(Path(folder) / "journal.jsonl")

        def remember(decision: Any) -> None:
            for change in (*decision.observed, *decision.made):
                if not isinstance(change, Retracted):
                    told[str(change.entry.ref)] = {**entry_record(change.entry), "cycle": decision.cycle}

        scheduler = Scheduler([expert_of(i, r) for i, r in enumerate(program)], sinks=[journal, remember],
                              retention=[Forget(Note), Forget(Tally)])
        scheduler.tell([Post(Note("a")), Post(Tally(1))], "user")
        with Archive(Path(folder) / "journal.jsonl") as archive:
            for _ in range(8):
                run(scheduler, 3)
                journal.flush()
                for ref, record in told.items():
                    found = archive.read(ref)
                    assert found is not None and {k: v for k, v in found.items() if k != "change"} == record
            assert archive.read("Note-999.0") is None
        journal.close()
        with Archive(Path(folder) / "journal.jsonl") as again:
            assert all(again.read(ref) is not None for ref in told)


def test_an_archive_notices_that_the_journal_is_another_one(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    first = [decision_line(d) for d in run(_posting("first"))]
    other = [decision_line(d) for d in run(_posting("other"))]
    path.write_text("\n".join(first) + "\n", encoding="utf-8")
    with Archive(path) as archive:
        assert archive.read("Note-1.0")["value"] == {"text": "first"}
    path.write_text("\n".join(other) + "\n" + other[0][:30], encoding="utf-8")
    with Archive(path) as archive:
        assert archive.read("Note-1.0")["value"] == {"text": "other"}


@pytest.mark.parametrize("line", ["nonsense", "[1]", '{"cycle":1}', '{"cycle":1,"observed":[{}],"made":[]}'])
def test_a_journal_that_is_none_is_named_with_its_byte(tmp_path: Path, line: str) -> None:
    path = tmp_path / "journal.jsonl"
    good = decision_line(run(_posting("a"))[0])
    path.write_text(f"{good}\n{line}\n", encoding="utf-8")
    with Archive(path) as archive, pytest.raises(ArchiveError, match=f"byte {len(good) + 1}: expected a decision"):
        archive.read("Note-1.0")


def _posting(text: str) -> Scheduler:
    scheduler = Scheduler([Scripted()])
    scheduler.tell([Post(Note(text))], "user")
    return scheduler


def test_lines_of_a_run_are_those_of_each_decision_alone() -> None:
    lines, alone = JournalLines(), []
    scheduler = Scheduler([expert_of(i, r) for i, r in enumerate([(Note, "both", 0.5, Level.PLAN)] * 3)],
                          sinks=[lambda d: alone.append((lines(d), decision_line(d)))])
    scheduler.tell([Post(Note("a"))], "user")
    run(scheduler, 30)
    assert len(alone) > 5 and all(one == other for one, other in alone)
    assert all(json.loads(one) for one, _ in alone)
