"""Why not: what a knowledge source or an entry could have brought about and did not, and what decided.

These answers are read from the journal. Whether a knowledge source that the journal does not name in a cycle could
have acted is asked of the knowledge source itself (:mod:`harvey.replay.why_not_again`).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from enum import Enum
from typing import Any, NamedTuple

from logs.explain.phrases import headline, sentence
from logs.records import Candidate, DecisionRecord, EntryRecord
from logs.timeline import Timeline
from world_models import words
from world_models.words import count

LEVELS = ("action", "plan", "goal")
REVISED = re.compile(r"is now|no longer held")
"""Reasons that only say that the same entry has changed again."""
SHOWN = 12
"""So many occasions are told."""


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
    found = [Occasion(cycle, Fate.DROPPED, c.trigger, _tell_drop(c)) for c in decision.obviated if c.source == source]
    for c in history.candidates(cycle):
        if c.source == source:
            is_chosen = decision.chosen is not None and c.number == decision.chosen.number
            fate, why = _act(decision) if is_chosen else (Fate.OUTRANKED, _tell_ranking(c, decision))
            why = f"it was the best there was, rated {c.rating:.2f}" if fate is Fate.ACTED else why
            found.append(Occasion(cycle, fate, c.trigger, why))
    return tuple(found)


def in_run(history: Timeline, source: str) -> tuple[Occasion, ...]:
    """Every time in a run that a knowledge source was woken, and what came of it in the end."""
    open_: dict[int, Candidate] = {}
    ended, last = list[Occasion](), 0
    for decision in history.decisions():
        last = decision.cycle
        open_ |= {c.number: c for c in decision.activated if c.source == source}
        ended += [Occasion(last, Fate.DROPPED, c.trigger, _tell_drop(c)) for c in decision.obviated
                  if open_.pop(c.number, None) is not None]
        chosen = decision.chosen
        if decision.asks is None and chosen is not None and open_.pop(chosen.number, None) is not None:
            ended.append(Occasion(last, _act(decision)[0], chosen.trigger, _act(decision)[1]))
    ended += [Occasion(last, Fate.OUTRANKED, c.trigger, "it was still waiting when the run ended")
              for c in open_.values()]
    return tuple(ended)


def _act(decision: DecisionRecord) -> tuple[Fate, str]:
    """What became of the act that was chosen."""
    if decision.refused:
        last = decision.refused.rstrip().splitlines()[-1]
        return Fate.REFUSED, f"its act was refused, and nothing of it applied: {last}"
    if decision.asks is not None:
        return Fate.ASKED, f"its act waited for the answer to {decision.asks.ref}: {sentence(decision.asks)}"
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
    yield f"{headline(record)}  [{ref}, cycle {record.cycle}]"
    yield from _end(history, record)
    yield from _use(history, record)


def _end(history: Timeline, record: EntryRecord[Any]) -> Iterator[str]:
    gone = history.retraction(record.ref)
    if (after := history.entry(f"{record.id}.{record.revision + 1}")) is not None:
        yield (f"It was superseded in cycle {after.cycle} by {after.ref}, which the {words.source(after.author)} wrote:"
               f" {sentence(after)}.")
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
            yield f"  {of} rests on {ref}: {sentence(ground)}."


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
