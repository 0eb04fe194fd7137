"""Why, over boards that come about at random: the walk tells every reason once and never runs in circles."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import (
    Change,
    Decision,
    Effect,
    Post,
    Posted,
    Retract,
    Retracted,
    Revise,
    Revised,
    Scheduler,
    View,
    decision_line,
)
from harvey.errors import BadInput
from harvey.replay.why_not_again import Fate, in_cycle, in_run, of_entry
from harvey.wiring import load_kinds
from logs.explain.diff import describe, differing_leaves, first_difference
from logs.explain.phrases import sentence
from logs.explain.web import SENSOR, cycle_lines, explain, explained_by, holds, trace_grounds, walk
from logs.explain.why import lines_of, story
from logs.records import Candidate, DecisionRecord, EntryRecord, as_line, decision_of
from logs.timeline import Timeline
from memory_timeline import MemoryTimeline
from strategies import Note, Scripted, Tally
from world_models.entries import LADDER

LAWS = settings(deadline=None, max_examples=60)
KNOWN = re.compile(", as (above|below)$")


def wilful(choices: list[int]) -> Scripted:
    """A knowledge source that posts, revises and retracts as the numbers say, each for reasons that they pick."""
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

    return Scripted("wilful", Note, act, kinds=(Posted, Revised, Retracted))


@st.composite
def journals(draw: st.DrawFn) -> list[str]:
    """The lines of a journal."""
    decisions: list[Decision] = []
    choices = draw(st.lists(st.integers(0, 60), min_size=1, max_size=120))
    second = Scripted("second", Tally, lambda view, trigger: [Post(Note("seen"), (trigger.entry,))], rate=0.4)
    scheduler = Scheduler([wilful(choices), second], sinks=(decisions.append,), ladder=LADDER)
    scheduler.post([Post(Note("first")), Post(Tally(1))], "user")
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
    known, history = entries(decisions), MemoryTimeline(decisions)
    ref = sorted(known)[pick % len(known)]
    told = [name for _, name, text in walk(history, [ref], depth=10**6) if not KNOWN.search(text)]
    assert len(told) == len(set(told))
    assert set(told) == grounds(known, ref)


@LAWS
@given(journals(), st.integers(0, 10**6), st.integers(0, 5))
def test_a_short_walk_is_the_beginning_of_the_whole_and_says_what_it_leaves_out(
    lines: list[str], pick: int, depth: int
) -> None:
    decisions = read(lines)
    known, history = entries(decisions), MemoryTimeline(decisions)
    ref = sorted(known)[pick % len(known)]
    reasons = list(walk(history, [ref], depth))
    assert max(level for level, _, _ in reasons) <= depth
    told = [name for _, name, text in reasons if not KNOWN.search(text)]
    assert len(told) == len(set(told))
    assert set(told) == within(known, ref, depth)
    hidden = [len(known[name].because) if level == depth and not KNOWN.search(text) else 0
              for level, name, text in reasons]
    for more, (_, _, text) in zip(hidden, reasons, strict=True):
        assert (f"(and so on: {more} reason" in text) == (more > 0)
    lines_told = list(explain(history, [ref], depth))
    assert ("--depth" in lines_told[-1]) == any(hidden)


@LAWS
@given(journals())
def test_every_reason_is_older_or_of_the_same_act(lines: list[str]) -> None:
    known = entries(read(lines))
    for record in known.values():
        for reason in record.because:
            assert known[reason].cycle <= record.cycle


@LAWS
@given(journals())
def test_a_cycle_tells_all_that_is_pending_and_nothing_else(lines: list[str]) -> None:
    history = MemoryTimeline(read(lines))
    for decision in read(lines):
        told = list(cycle_lines(decision, history.candidates(decision.cycle)))
        assert sum(line.startswith(("  pending", "  next")) for line in told) == decision.pending
        assert sum(line.startswith("  chooses") for line in told) == (decision.chosen is not None)
        assert all(any(change.ref in line for line in told) for change in decision.made)


@LAWS
@given(journals(), journals())
def test_diff_finds_the_first_line_that_differs(ours: list[str], theirs: list[str]) -> None:
    agreed, one, other = first_difference(*(MemoryTimeline(read(lines)) for lines in (ours, theirs)))
    assert ours[:agreed] == theirs[:agreed]
    if one is None and other is None:
        assert ours == theirs
    else:
        assert ours[agreed : agreed + 1] != theirs[agreed : agreed + 1]
    assert f"{agreed} decision" in next(iter(describe(agreed, one, other)))


@LAWS
@given(journals(), st.binary(max_size=30).filter(lambda tail: b"\n" not in tail), st.integers(0, 10**6))
def test_a_file_that_is_swept_tells_what_a_file_that_is_read_tells(lines: list[str], tail: bytes, pick: int) -> None:
    told = MemoryTimeline(read(lines))
    with NamedTemporaryFile() as file:
        file.write("".join(line + "\n" for line in lines).encode() + tail)
        file.flush()
        swept = Timeline(Path(file.name))
    assert swept.refs == told.refs
    assert swept.newest == told.newest
    assert swept.cycles == told.cycles
    assert [swept.entry(ref) for ref in told.refs] == [told.entry(ref) for ref in told.refs]
    assert [swept.retraction(ref) for ref in told.refs] == [told.retraction(ref) for ref in told.refs]
    assert list(swept.decisions()) == list(told.decisions())
    ref = told.refs[pick % len(told.refs)]
    assert list(explain(swept, [ref])) == list(explain(told, [ref]))
    assert {d.cycle for d in told.decisions() if f'"{ref}"' in d.line} == {d.cycle for d in swept.naming(ref)}


@LAWS
@given(journals())
def test_an_oddly_written_file_tells_the_same(lines: list[str]) -> None:
    told = MemoryTimeline(read(lines))
    with NamedTemporaryFile("w") as file:
        file.write("".join(json.dumps(json.loads(line)) + "\n" for line in lines))
        file.flush()
        swept = Timeline(Path(file.name))
    assert swept.refs == told.refs
    assert list(swept.decisions()) == list(told.decisions())


def sensed(record: EntryRecord) -> str | None:
    """In these laws a tally is what is sensed."""
    return SENSOR if record.type == "Tally" else None


@LAWS
@given(journals())
def test_a_decision_is_explained_exactly_if_the_closure_of_each_effect_has_a_ground(lines: list[str]) -> None:
    decisions = read(lines)
    known = entries(decisions)
    for decision, ends in trace_grounds(decisions, sensed):
        assert tuple(ends) == explained_by(decision)
        for ref, found in ends.items():
            is_sensed = any(known[r].type == "Tally" for r in grounds(known, ref))
            assert found == ({SENSOR} if is_sensed else set())
            assert holds(found) == is_sensed


@LAWS
@given(st.dictionaries(st.integers(0, 9), st.lists(st.integers(0, 12), max_size=4), min_size=1))
def test_what_an_entry_rests_on_is_named_and_so_is_what_is_lacking(graph: dict[int, list[int]]) -> None:
    """Reasons are older than what rests on them, or the journal says nothing of them."""
    known = {f"Note-{n}.0": EntryRecord("Posted", f"Note-{n}.0", "Tally" if n == 7 else "Note", "source",
                                        tuple(f"Note-{m}.0" for m in graph[n] if m < n or m not in graph), {}, 1, False)
             for n in sorted(graph)}
    decisions = [DecisionRecord(cycle, "action", (), (), (), (), None, None, 0, (record,), "", {})
                 for cycle, record in enumerate(known.values(), 1)]
    for (_, ends), name in zip(trace_grounds(decisions, sensed), known, strict=True):
        reached, todo = set[str](), [name]
        while todo:
            if (ref := todo.pop()) not in reached:
                reached.add(ref)
                todo += known[ref].because if ref in known else ()
        lacking = reached - known.keys()
        assert ends[name] == lacking | ({SENSOR} if "Note-7.0" in reached & known.keys() else set())
        assert not (lacking and holds(ends[name]))


@LAWS
@given(journals())
def test_candidates_are_those_that_the_trace_keeps(lines: list[str]) -> None:
    decisions = read(lines)
    told, pending = MemoryTimeline(decisions), dict[int, Candidate]()
    for d in decisions:
        pending |= {c.number: c for c in d.activated}
        for c in d.obviated:
            pending.pop(c.number, None)
        assert {c.number: c for c in told.candidates(d.cycle)} == pending
        if d.chosen is not None:
            assert told.candidates(d.cycle)[0].number == d.chosen.number
            del pending[d.chosen.number]


@LAWS
@given(journals(), st.sampled_from(["wilful", "second"]))
def test_why_not_agrees_with_a_plain_reading(lines: list[str], source: str) -> None:
    decisions = read(lines)
    told = MemoryTimeline(decisions)
    activated = [c.number for d in decisions for c in d.activated if c.source == source]
    acted = [d.cycle for d in decisions if d.chosen is not None and d.chosen.source == source and not d.refused]
    dropped = [d.cycle for d in decisions for c in d.obviated if c.source == source]
    occasions = in_run(told, source)
    assert len(occasions) == len(activated)
    assert [o.cycle for o in occasions if o.fate is Fate.ACTED] == acted
    assert [o.cycle for o in occasions if o.fate is Fate.DROPPED] == dropped
    for d in decisions:
        fates = [o.fate for o in in_cycle(told, source, d.cycle)]
        assert fates.count(Fate.DROPPED) == sum(c.source == source for c in d.obviated)
        mine = [c for c in told.candidates(d.cycle) if c.source == source]
        assert len(fates) - fates.count(Fate.DROPPED) == len(mine)
        assert (Fate.ACTED in fates) == (d.cycle in acted)


@LAWS
@given(journals(), st.integers(0, 10**9), st.integers(0, 255), st.integers(0, 10**6))
def test_a_broken_byte_is_told_by_file_and_line_or_does_not_matter(
    lines: list[str], at: int, byte: int, pick: int
) -> None:
    data = bytearray("".join(line + "\n" for line in lines).encode())
    data[at % len(data)] = byte
    with NamedTemporaryFile() as file:
        file.write(data)
        file.flush()
        try:
            history = Timeline(Path(file.name))
            for ref in history.refs:
                list(explain(history, [ref]))
                list(of_entry(history, ref))
            list(history.decisions())
        except BadInput as error:
            assert re.search(rf"{re.escape(file.name)}:\d+: ", str(error))


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
@given(st.sampled_from([*load_kinds(), "Unheard"]), json_values, st.sampled_from(["Posted", "Revised", "Retracted"]))
def test_every_value_has_a_sentence(kind: str, value: Any, change: str) -> None:
    told = sentence(EntryRecord(change, f"{kind}-1.0", kind, "source", (), value, 1, False))
    assert isinstance(told, str)
    assert ("no longer believed" in told) == (change == "Retracted")


@settings(deadline=None, max_examples=200)
@given(st.lists(
    st.tuples(st.sampled_from([*load_kinds(), "Unheard"]), json_values, st.lists(st.integers(0, 14), max_size=4)),
    min_size=1, max_size=12))
def test_the_story_of_any_web_of_entries_ends_and_tells_each_thing_once(
    web: list[tuple[str, Any, list[int]]]
) -> None:
    """Whatever the values are, and however the reasons run, in circles too."""
    refs = [f"{type}-{number}.0" for number, (type, _, _) in enumerate(web)]
    made = [EntryRecord("Posted", ref, type, "source", tuple(refs[k % len(refs)] for k in below), value, 1, False)
            for ref, (type, value, below) in zip(refs, web, strict=True)]
    decision = DecisionRecord(1, "plan", (), (), (), (), None, None, 0, tuple(made), "", {})
    history = MemoryTimeline([decision])
    for record in made:
        told = story(history, record)
        assert len({(step.text, step.refs) for step in told.steps}) == len(told.steps)
        assert all(history.entry(ref) is not None for step in told.steps for ref in step.refs)
        assert "\n".join(lines_of(told))
