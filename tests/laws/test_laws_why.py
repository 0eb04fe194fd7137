"""Why, over boards that come about at random: the walk tells every reason once and never runs in circles."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard.board import View
from blackboard.change import Change, Posted, Retracted, Revised
from blackboard.effect import Effect, Post, Retract, Revise
from blackboard.journal import Decision, decision_line
from blackboard.scheduler import Scheduler
from harvey.diff import describe, differing_leaves, first_difference
from harvey.records import DecisionRecord, EntryRecord, as_line, decision_of
from harvey.sentences import MAKERS, sentence
from harvey.trace import Trace
from harvey.why import History, explain, walk
from strategies import Expert, Note, Tally

LAWS = settings(deadline=None, max_examples=60)


def wilful(choices: list[int]) -> Expert:
    """An expert that posts, revises and retracts as the numbers say, each for reasons that they pick."""
    numbers = iter(choices)

    def act(view: View, _trigger: Change) -> Iterable[Effect]:
        effects: list[Effect] = []
        touched: set[str] = set()
        for _ in range(next(numbers, 0) % 3):
            notes = [e for e in (*view.all(Note), *view.all(Tally)) if e.id not in touched]
            what, which = next(numbers, 0), next(numbers, 0)
            because: tuple[Any, ...] = tuple(notes[(which + k) % len(notes)] for k in range(what % 4)) if notes else ()
            because += tuple(effects[:1])
            if what % 3 == 0 or not notes:
                effects.append(Post(Note(str(what)) if what % 2 else Tally(what), because))
                continue
            entry = notes[which % len(notes)]
            touched.add(entry.id)
            gone = what % 3 == 1 and what % 2 == 0
            effects.append(Retract(entry, because) if gone else Revise(entry, entry.value, because))
        return effects

    return Expert("wilful", Note, act, kinds=(Posted, Revised, Retracted))


@st.composite
def journals(draw: st.DrawFn) -> list[str]:
    """The lines of a journal."""
    decisions: list[Decision] = []
    choices = draw(st.lists(st.integers(0, 60), min_size=1, max_size=120))
    rival = Expert("rival", Tally, lambda view, trigger: [Post(Note("seen"), (trigger.entry,))], rate=0.4)
    scheduler = Scheduler([wilful(choices), rival], sinks=(decisions.append,))
    scheduler.tell([Post(Note("first")), Post(Tally(1))], "user")
    for _ in range(40):
        if scheduler.step() is None:
            break
    return [decision_line(d) for d in decisions]


def read(lines: list[str]) -> list[DecisionRecord]:
    return [decision_of(json.loads(line)) for line in lines]


def entries(decisions: list[DecisionRecord]) -> dict[str, EntryRecord]:
    """Every revision by its ref."""
    return {r.ref: r for d in decisions for r in (*d.observed, *d.made) if r.change != "Retracted"}


def grounds(known: dict[str, EntryRecord], ref: str) -> set[str]:
    """Everything that an entry rests on, and itself: the closure, found the plain way."""
    found: set[str] = set()
    todo = [ref]
    while todo:
        name = todo.pop()
        if name not in found:
            found.add(name)
            todo += known[name].because
    return found


def within(known: dict[str, EntryRecord], ref: str, steps: int) -> set[str]:
    """What an entry rests on in so many steps."""
    found = {ref}
    for _ in range(steps):
        found |= {reason for name in found for reason in known[name].because}
    return found


@LAWS
@given(journals(), st.integers(0, 10**6))
def test_the_whole_walk_is_the_closure_and_tells_each_entry_once(lines: list[str], pick: int) -> None:
    decisions = read(lines)
    known, history = entries(decisions), History(decisions)
    ref = sorted(known)[pick % len(known)]
    reasons = list(walk(history, [ref], depth=10**6))
    told = [r.ref for r in reasons if not r.known]
    assert len(told) == len(set(told))
    assert set(told) == grounds(known, ref)
    assert all(r.record == known[r.ref] for r in reasons)


@LAWS
@given(journals(), st.integers(0, 10**6), st.integers(0, 5))
def test_a_short_walk_is_the_beginning_of_the_whole_and_says_what_it_leaves_out(
    lines: list[str], pick: int, depth: int
) -> None:
    decisions = read(lines)
    known, history = entries(decisions), History(decisions)
    ref = sorted(known)[pick % len(known)]
    reasons = list(walk(history, [ref], depth))
    assert max(r.depth for r in reasons) <= depth
    told = [r.ref for r in reasons if not r.known]
    assert len(told) == len(set(told))
    assert set(told) == within(known, ref, depth)
    for reason in reasons:
        assert reason.hidden == (len(known[reason.ref].because) if reason.depth == depth and not reason.known else 0)
    lines_told = list(explain(history, [ref], depth))
    assert ("--depth" in lines_told[-1]) == any(r.hidden for r in reasons)


@LAWS
@given(journals())
def test_every_reason_is_older_or_of_the_same_act(lines: list[str]) -> None:
    known = entries(read(lines))
    for record in known.values():
        for reason in record.because:
            assert known[reason].cycle <= record.cycle


@LAWS
@given(journals())
def test_the_trace_tells_all_that_is_pending_and_nothing_else(lines: list[str]) -> None:
    trace = Trace()
    for decision in read(lines):
        told = list(trace.lines(decision))
        assert sum(line.startswith(("  pending", "  next")) for line in told) == decision.pending
        assert sum(line.startswith("  chooses") for line in told) == (decision.chosen is not None)
        assert all(any(change.ref in line for line in told) for change in decision.made)


@LAWS
@given(journals(), journals())
def test_diff_finds_the_first_line_that_differs(ours: list[str], theirs: list[str]) -> None:
    agreed, one, other = first_difference(iter(read(ours)), iter(read(theirs)))
    assert ours[:agreed] == theirs[:agreed]
    if one is None and other is None:
        assert ours == theirs
    else:
        assert ours[agreed : agreed + 1] != theirs[agreed : agreed + 1]
    assert f"{agreed} decision" in next(iter(describe(agreed, one, other)))


json_values = st.recursive(
    st.none() | st.booleans() | st.integers(-5, 5) | st.floats(allow_nan=False) | st.text(max_size=2),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from("abc"), inner, max_size=3),
    max_leaves=8,
)


@LAWS
@given(json_values, json_values)
def test_leaves_differ_where_values_do(a: Any, b: Any) -> None:
    assert (not list(differing_leaves(a, b))) == (as_line(a) == as_line(b))
    assert not list(differing_leaves(a, a))


@settings(deadline=None, max_examples=200)
@given(st.sampled_from([*MAKERS, "Unheard"]), json_values, st.sampled_from(["Posted", "Revised", "Retracted"]))
def test_every_value_has_a_sentence(kind: str, value: Any, change: str) -> None:
    told = sentence(EntryRecord(change, f"{kind}-1.0", kind, "expert", (), value, 1, False))
    assert isinstance(told, str)
    assert ("no longer believed" in told) == (change == "Retracted")
