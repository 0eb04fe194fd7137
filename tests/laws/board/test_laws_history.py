"""A history: saved and read it is the same, it is decided again the same, and it says why down to the outside."""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntEnum
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from blackboard import (
    Change,
    Effect,
    History,
    Ladder,
    Level,
    Post,
    Posted,
    Retract,
    Revise,
    Scheduler,
    View,
    Watch,
    rule,
)
from blackboard.kinds import NotAKindError
from strategies import Note, Scripted, Tally
from world_models.entries import OPEN, Discrepancy

TEXTS = st.lists(st.text(max_size=3), min_size=1, max_size=5)


@rule(on=Watch(Note, (Posted,)), writes=(Note, Tally), priority=0.7)
def counter(view: View, trigger: Change) -> Iterable[Effect]:
    known = view.latest(Tally)
    if known is None:
        yield Post(Tally(len(trigger.entry.value.text)), (trigger.entry,))
    else:
        yield Revise(known, Tally(known.value.count + len(trigger.entry.value.text)))
    if not trigger.entry.value.text:
        yield Retract(trigger.entry)


@rule(on=Watch(Tally), writes=Note)
def complainer(view: View, trigger: Change) -> Iterable[Effect]:
    if trigger.entry.value.count > 2 and not view.where(Note, lambda note: note.text == "too many"):
        yield Post(Note("too many"))


SOURCES = (counter, complainer)


def drive(texts: list[str]) -> tuple[Scheduler, History]:
    history = History()
    scheduler = Scheduler(SOURCES, sinks=[history])
    for text in texts:
        scheduler.post([Post(Note(text))], "user")
        scheduler.run(1)
    scheduler.run()
    return scheduler, history


@given(TEXTS)
def test_saved_and_read_it_is_the_same_and_decided_again_it_is_the_same(texts: list[str]) -> None:
    _, history = drive(texts)
    again = History(history.lines)
    assert again.lines == history.lines and again.replay(Scheduler(SOURCES)) is None
    assert again.parts_from(history) == ""


def test_it_is_written_and_read(tmp_path: Path) -> None:
    _, history = drive(["a", "bcd"])
    history.save(tmp_path / "run.jsonl")
    assert History.read(tmp_path / "run.jsonl").lines == history.lines
    with pytest.raises(ValueError, match=r"line 2: expected a decision, got .*nonsense"):
        History([history.lines[0], '"nonsense"'])


@given(texts=TEXTS, at=st.integers(0, 4), priority=st.sampled_from((0.1, 0.9)))
def test_other_sources_or_other_words_part_in_the_first_cycle_that_differs(
    texts: list[str], at: int, priority: float
) -> None:
    _, history = drive(texts)
    hurried = type("counter", (type(counter),), {"priority": priority})()
    assert history.replay(Scheduler([hurried, complainer])) == 1  # the rating stands in the first line
    at = min(at, len(texts))
    _, other = drive([*texts[:at], "other", *texts[at:]])
    alike = next(i for i, (a, b) in enumerate(zip([*history.lines, ""], other.lines, strict=False)) if a != b)
    assert history.parts_from(other).startswith(f"cycle {alike + 1}: ")


@given(TEXTS)
def test_who_names_no_reasons_rests_on_the_trigger_and_on_what_was_read(texts: list[str]) -> None:
    scheduler, _ = drive(texts)
    for entry in scheduler.view.all(Tally):
        if entry.revision:
            kinds = [ref.id.partition("-")[0] for ref in entry.because]
            assert kinds == ["Note", "Tally"] and entry.because[1].revision == entry.revision - 1
    for note in scheduler.view.where(Note, lambda note: note.text == "too many"):
        assert note.author != "complainer" or note.because[0].id.startswith("Tally-")


@given(TEXTS)
def test_why_goes_down_to_what_came_from_outside(texts: list[str]) -> None:
    scheduler, history = drive(texts)
    for entry in scheduler.view.all(Tally):
        lines = history.why(entry.id).splitlines()
        assert lines[0].startswith(f"{entry.ref}: count {entry.value.count} (by counter, cycle ")
        told = [line.split(":")[0].strip() for line in lines if "see above" not in line]
        assert len(told) == len(set(told))
        assert sum("(from user, cycle " in line for line in lines) >= 1
    with pytest.raises(KeyError, match="expected one of "):
        history.why("Nothing-1")


@given(TEXTS)
def test_what_is_posted_can_be_replayed_and_who_woke_whom_adds_up_to_the_cycles_that_acted(texts: list[str]) -> None:
    scheduler, history = drive(texts)
    assert History.of(SOURCES, user=map(Note, texts)).replay(Scheduler(SOURCES)) is None
    times = [int(line.rpartition(" x ")[2].rstrip('"]')) for line in history.to_dot().splitlines()[1:-1]]
    assert sum(times) == sum('"chosen":{' in line for line in history.lines)
    assert str(scheduler.board).count("(by ") == len(scheduler.view)
    with pytest.raises(NotAKindError, match=r"kinds=\[Discrepancy\]"):
        scheduler.post([Post(Discrepancy(Level.GOAL, "far", None, (1.0, 1.0), "m"))], "user")


@given(TEXTS)
def test_a_program_without_levels_writes_none(texts: list[str]) -> None:
    _, flat = drive(texts)
    assert not any('"level"' in line or '"focus"' in line for line in flat.lines)
    laddered = History.of([*SOURCES, Scripted("goal", Note, level=Level.GOAL)], user=[Note(texts[0])])
    assert all('"focus":"action"' in line for line in laddered.lines)


class Floor(IntEnum):
    """Two levels of a system of its own."""

    GROUND = 1
    ROOF = 2


def test_levels_are_the_users() -> None:
    """Nearest to the focus first; the focus is the highest open discrepancy, and the highest level has no bound."""
    done: list[str] = []

    def worker(name: str, level: Floor) -> Scripted:
        def act(_view: View, _trigger: Change) -> Iterable[Effect]:
            done.append(name)
            return ()

        return Scripted(name, Note, act, level=level)  # type: ignore[arg-type]

    sources = [worker("up", Floor.ROOF), worker("down", Floor.GROUND)]
    scheduler = Scheduler(sources, ladder=Ladder(Floor, OPEN), kinds=[Discrepancy])
    scheduler.post([Post(Note("a"))], "user")
    scheduler.run()
    assert done == ["down", "up"]
    found: Any = Discrepancy(Floor.GROUND, "it leans", 3.0, (2.0, 9.0), "m")  # type: ignore[arg-type]
    assert found.bound == 2.0 and found.exceeds
    _, raised = found.escalated()
    assert raised.level is Floor.ROOF and raised.bound == float("inf")
    scheduler.post([Post(raised), Post(Note("b"))], "user")
    scheduler.run()
    assert done == ["down", "up", "up", "down"]
