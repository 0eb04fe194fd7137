"""``harvey why RUN --not NAME``: what a knowledge source or an entry could have brought about and did not, and what
decided; read from the journal, and, of a knowledge source that the journal does not name in a cycle, asked again: could
it have acted, and if not, which need was not met?

The board as it stood is rebuilt from the journal, and ``bind`` is asked once more. That is honest as far as ``bind`` is
what it has to be, a pure function of the board; no act is repeated and no picture is looked at.
"""

from __future__ import annotations

import difflib
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from enum import Enum
from typing import Any, NamedTuple

from blackboard import (
    Blackboard,
    Change,
    KnowledgeSource,
    MissingEntryError,
    Posted,
    Registry,
    Retracted,
)
from harvey.errors import BadInput
from logs.explain import phrases
from logs.records import CHANGES, Candidate, DecisionRecord, EntryRecord, entry_of
from logs.run_directory import RunDirectory
from logs.timeline import Timeline
from world_models import words
from world_models.frame_store import FrameStore
from world_models.words import count, sentence

LEVELS = ("action", "plan", "goal")
REVISED = re.compile(r"is now|no longer held")
"""Reasons that only say that the same entry has changed again."""
SHOWN = 12
"""Most occasions that are listed."""


class Fate(Enum):
    """What became of a knowledge source in a cycle."""

    ACTED = "acted"
    ASKED = "asked for what it lacked"
    REFUSED = "acted, and was refused"
    DROPPED = "was dropped"
    OUTRANKED = "was not chosen"


class Occasion(NamedTuple):
    """One time that a knowledge source could have acted: when, what came of it, on what, and what decided."""

    cycle: int
    fate: Fate
    trigger: str
    why: str


def in_cycle(history: Timeline, source: str, cycle: int) -> tuple[Occasion, ...]:
    """What became of a knowledge source in one cycle, for each trigger; none where the journal does not name it.

    Raises BadInput where the run has no such cycle.
    """
    decision = history.decision(cycle)
    waiting = (c for c in history.candidates(cycle) if c.source == source and c != decision.chosen)
    return (*_had_its_turn(decision, source),
            *(Occasion(cycle, Fate.OUTRANKED, c.trigger, _tell_ranking(c, decision)) for c in waiting))


def in_run(history: Timeline, source: str) -> tuple[Occasion, ...]:
    """Every time in a run that a knowledge source was woken, and what came of it in the end."""
    ended = [one for decision in history.decisions() for one in _had_its_turn(decision, source)
             if one.fate is not Fate.ASKED]
    for last in history.cycles[-1:]:
        chosen = None if (end := history.decision(last)).asks is not None else end.chosen
        ended += [Occasion(last, Fate.OUTRANKED, c.trigger, "it was still waiting when the run ended")
                  for c in history.candidates(last) if c.source == source and c != chosen]
    return tuple(ended)


def _had_its_turn(decision: DecisionRecord, source: str) -> Iterator[Occasion]:
    """What a knowledge source was dropped from in a cycle, and what came of its act."""
    for c in decision.obviated:
        if c.source == source:
            yield Occasion(decision.cycle, Fate.DROPPED, c.trigger, _tell_drop(c))
    if (chosen := decision.chosen) is not None and chosen.source == source:
        fate, why = _act(decision)
        why = f"it was the best there was, rated {chosen.rating:.2f}" if fate is Fate.ACTED else why
        yield Occasion(decision.cycle, fate, chosen.trigger, why)


def _act(decision: DecisionRecord) -> tuple[Fate, str]:
    """What became of the act that was chosen."""
    if decision.refused:
        last = decision.refused.rstrip().splitlines()[-1]
        return Fate.REFUSED, f"its act was refused, and nothing of it applied: {last}"
    if decision.asks is not None:
        return Fate.ASKED, f"its act waited for the answer to {decision.asks.ref}: {phrases.sentence(decision.asks)}"
    return Fate.ACTED, f"it made {', '.join(r.ref for r in decision.made) or 'nothing'}"


def _tell_drop(c: Candidate) -> str:
    waited = f"it had waited since cycle {c.since}, rated {c.rating:.2f}; " if c.rating else ""
    reason = {"trigger no longer holds": "what woke it no longer held"}.get(c.reason, c.reason)
    return f"{waited}{reason}"


def _tell_ranking(c: Candidate, decision: DecisionRecord) -> str:
    """By what the chosen activation came before this one: focus, then rating, then age."""
    chosen = decision.chosen
    if chosen is None:
        return f"nobody acted ({_act(decision)[1]})" if decision.refused else "nobody acted"
    who = f"the {words.source(chosen.source)} (on {chosen.trigger})"
    ours, theirs = _distance(c, decision.focus), _distance(chosen, decision.focus)
    if ours != theirs:
        return (f"the {decision.focus} level was in focus, and {who} works at the {chosen.level} level, it at the"
                f" {c.level} level (rated {chosen.rating:.2f} and {c.rating:.2f})")
    if c.rating != chosen.rating:
        return f"{who} was rated {chosen.rating:.2f}, it {c.rating:.2f}"
    return f"{who} was rated as well as it, {c.rating:.2f}, and had waited longer"


def _distance(c: Candidate, focus: str) -> int:
    if c.level not in LEVELS or focus not in LEVELS:
        return 0
    return abs(LEVELS.index(c.level) - LEVELS.index(focus))


def tell_fates(source: str, occasions: tuple[Occasion, ...]) -> Iterator[str]:
    """What became of a knowledge source, in sentences; one that always acted is said to have."""
    tally = Counter(o.fate for o in occasions)
    if not occasions:
        yield f"The {words.source(source)} was never able to act in this run."
        return
    parts = [f"{fate.value} {count(tally[fate], 'time')}" for fate in Fate if tally[fate]]
    yield f"The {words.source(source)} was able to act {count(len(occasions), 'time')}: it {', '.join(parts)}."
    late = [o for o in occasions if o.fate is Fate.DROPPED and REVISED.search(o.why)]
    if late:
        yield (f"  {count(len(late), 'time')} what had woken it was revised before its turn came, first in cycle"
               f" {late[0].cycle}: {late[0].why}.")
    missed = [o for o in occasions if o.fate is not Fate.ACTED and o not in late]
    for o in missed[:SHOWN]:
        yield f"  cycle {o.cycle}: on {o.trigger} it {o.fate.value}: {o.why}."
    if len(missed) > SHOWN:
        yield f"  and {len(missed) - SHOWN} more times."


def of_entry(history: Timeline, ref: str) -> Iterator[str]:
    """Why an entry did not stay or did not count: what replaced it, who withdrew it, whom it woke, what rests on it."""
    record = history.entry(ref)
    if record is None:
        yield f"The journal says nothing of {ref}."
        return
    yield f"{phrases.headline(record)}  [{ref}, cycle {record.cycle}]"
    yield from _end(history, record)
    yield from _use(history, record)


def _end(history: Timeline, record: EntryRecord[Any]) -> Iterator[str]:
    gone = history.retraction(record.ref)
    if (after := history.entry(f"{record.id}.{record.revision + 1}")) is not None:
        yield (f"It was superseded in cycle {after.cycle} by {after.ref}, which the {words.source(after.author)} wrote:"
               f" {phrases.sentence(after)}.")
        yield from _grounds(history, after.because, after.ref, record.ref)
    elif gone is not None:
        decision = history.decision(gone.cycle)
        who = f" by the {words.source(decision.chosen.source)}" if decision.chosen else ""
        yield f"It was withdrawn in cycle {gone.cycle}{who}."
        yield from _grounds(history, gone.retracted_because, "the withdrawal", record.ref)
    else:
        yield "Nothing took its place: it stood until the run ended."


def _grounds(history: Timeline, refs: tuple[str, ...], of: str, without: str) -> Iterator[str]:
    for ref in refs:
        ground = history.entry(ref)
        if ground is not None and ref != without:
            yield f"  {of} rests on {ref}: {phrases.sentence(ground)}."


def _use(history: Timeline, record: EntryRecord[Any]) -> Iterator[str]:
    """Who was woken by it and what came of that; what rests on it."""
    resting, fates = list[str](), list[str]()
    for decision in history.naming(record.ref):
        resting += [r.ref for r in decision.made if record.ref in r.because]
        fates += [f"  cycle {decision.cycle}: it woke the {words.source(c.source)}, which was dropped: {_tell_drop(c)}."
                  for c in decision.obviated if c.trigger == record.ref]
        if decision.chosen is not None and decision.chosen.trigger == record.ref:
            fate, what = _act(decision)
            how = f", and {what}" if fate is Fate.ASKED else f", which acted: {what}"
            fates.append(f"  cycle {decision.cycle}: it woke the {words.source(decision.chosen.source)}{how}.")
    yield from fates or ["  It woke nobody who then acted."]
    yield f"Resting on it: {', '.join(dict.fromkeys(resting))}." if resting else "Nothing rests on it."


def answers(run: RunDirectory, history: Timeline, name: str, cycle: int | None) -> Iterator[str]:
    """Why a knowledge source did not act (in a cycle), or why an entry did not stay.

    Raises:
        BadInput: the run has no such entry and no such knowledge source; near ones are named.
    """
    if "-" in name:
        yield from of_entry(history, history.resolve(name))
        return
    source = name.lower().replace(" ", "_")
    if cycle is None:
        occasions = in_run(history, source)
        if not occasions:
            yield from _ask_again(run, history, source, None)
        yield from tell_fates(source, occasions)
        return
    found, decision = in_cycle(history, source, cycle), history.decision(cycle)
    for one in found:
        yield f"In cycle {cycle} the {words.source(source)} {one.fate.value} on {one.trigger}: {one.why}."
    if not found:
        yield from _ask_again(run, history, source, cycle)
    if decision.chosen is None:
        yield f"Nobody acted in cycle {cycle}."
    elif not any(one.fate in (Fate.ACTED, Fate.ASKED) for one in found):
        chosen, made = decision.chosen, ", ".join(r.ref for r in decision.made) or "nothing"
        yield (f"The {words.source(chosen.source)} acted, on {chosen.trigger}, rated {chosen.rating:.2f}, with the"
               f" {decision.focus} level in focus: it made {made}.")


def _ask_again(run: RunDirectory, history: Timeline, source: str, cycle: int | None) -> Iterator[str]:
    """Whether it sat at the board at all; of a cycle, it is asked once more, on the board as it was."""
    from harvey.agent import build_agent
    from logs.run_head import RunHead

    head = RunHead.read(run.path)
    if source in head.without:
        yield f"The {words.source(source)} was left out of this run."
        return
    agent = build_agent(head)
    sources = {one.name: one for one in agent.sources}
    if source not in sources:
        near = difflib.get_close_matches(source, sources, n=4, cutoff=0.5) or sources
        raise BadInput(
            f"--not: expected a knowledge source as {', '.join(near)}, or an entry as Goal-1, got {source!r}")
    closes = sources[source].closes
    if not agent.servoing.allows(closes):
        yield f"The {closes} level of servoing was off, and the {words.source(source)} closes it."
    elif cycle is not None:
        yield from why_absent(history, sources[source], cycle, agent.kinds, agent.store)


def why_absent(
    history: Timeline, source: KnowledgeSource, cycle: int, kinds: Registry, store: FrameStore
) -> Iterator[str]:
    """Why a knowledge source was not among those that could act in a cycle, in sentences.

    Raises:
        BadInput: the run has no such cycle, or a value of the journal is not of its type.
    """
    seen = changes(history, cycle, kinds, store)
    woken = [change for change in seen if any(watch.sees(change) for watch in source.on)]
    if not woken:
        yield from _tell_why_not_triggered(source, seen, cycle)
        return
    board = board_at(history, cycle, kinds, store)
    for change in woken:
        yield from tell_of_trigger(source, board, change)


def _tell_why_not_triggered(source: KnowledgeSource, seen: Sequence[Change], cycle: int) -> Iterator[str]:
    """Nothing came of the kinds that it watches for, or the condition of its watch did not hold for what came."""
    name = words.source(source.name)
    held_back = [change for change in seen if any(
        watch.is_for(type(change), type(change.entry.value)) for watch in source.on)]
    if held_back:
        came = ", ".join(f"{change.entry.ref} {change.kind.lower()}" for change in held_back)
        yield (f"In cycle {cycle} came what the {name} watches for, {came}, but its watch has a condition, which did"
               " not hold for the values:")
        yield from (f"  {change.entry.ref}: {sentence(change.entry.value)}" for change in held_back)
        return
    watched = ", ".join(dict.fromkeys(f"{w.value_type.__name__} {_kinds(w.kinds)}" for w in source.on))
    came = ", ".join(f"{change.entry.ref} {change.kind.lower()}" for change in seen) or "nothing"
    yield f"Nothing that the {name} watches for came in cycle {cycle}. It watches for: {watched}; what came: {came}."


def tell_of_trigger(source: KnowledgeSource, board: Blackboard, change: Change) -> Iterator[str]:
    """Whether a source could have acted on a change that woke it, and if not, for what reason; in sentences."""
    name, ref = words.source(source.name), change.entry.ref
    if not isinstance(change, Retracted) and not board.view.is_current(change.entry):
        now = board.view.get(change.entry.id)
        yield f"{ref} would have woken the {name}, but was {f'{now.ref} already' if now else 'withdrawn already'}."
        return
    try:
        unmet = source.find_unmet(board.view)
        if unmet is not None:
            yield f"{ref} woke the {name}. It needs: {unmet.name}; {unmet.tell_otherwise(board.view)}."
            return
        case = source.bind(board.view, change)
    except MissingEntryError as missing:
        yield (f"{ref} woke the {name}; asked again, it lacks something to tell whether it could act:"
               f" it {sentence(missing.request)}.")
        return
    if case is not None:
        rating = float(source.rate(case))
        yield f"{ref} woke the {name}; asked again, it says that it could have acted, rated {rating:.2f}."
        return
    yield f"{ref} woke the {name}, but it could not act: what it takes besides was not on the board."


def _kinds(kinds: Iterable[type[Change]]) -> str:
    return "/".join(kind.__name__.lower() for kind in kinds)


def changes(history: Timeline, cycle: int, kinds: Registry, store: FrameStore) -> tuple[Change, ...]:
    """What a cycle took up: what the one before had made, and what came from outside. Raises BadInput."""
    decision = history.decision(cycle)
    outside = {r.ref for r in decision.observed}
    last = history.cycle_of(cycle - 1)
    before = [] if last is None else [r for r in last.made if r.ref in decision.seen and r.ref not in outside]
    return tuple(CHANGES.get(r.change, Posted)(entry_of(r, kinds, store)) for r in (*before, *decision.observed))


def board_at(history: Timeline, cycle: int, kinds: Registry, store: FrameStore) -> Blackboard:
    """The board as knowledge sources saw it when they were asked in a cycle. Raises BadInput."""
    last: dict[str, EntryRecord[Any]] = {}  # older revisions cannot be seen any more
    for one in history.cycles:
        if one <= cycle:
            decision = history.decision(one)
            last |= {record.id: record for record in (decision.changes if one < cycle else decision.observed)}
    board = Blackboard()
    for record in last.values():
        if not record.is_gone:
            board.follow(Posted(entry_of(record, kinds, store)))
    return board
