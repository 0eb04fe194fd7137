"""A run cycle by cycle, for people: the changes, the candidates with their ratings, the choice and its effects."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TextIO

from blackboard.journal import Decision, Sink, decision_record
from harvey.run_files.records import Candidate, DecisionRecord, EntryRecord, decision_of
from harvey.why.sentences import sentence


def printing(out: TextIO) -> Sink:
    """A sink that prints every cycle."""
    trace = Trace()

    def sink(decision: Decision) -> None:
        out.write("\n".join(trace.lines(decision_of(decision_record(decision)))) + "\n")

    return sink


class Trace:
    """Tells decisions one after the other; it remembers what is pending, as the journal tells only what is new."""

    def __init__(self) -> None:
        self._pending: dict[int, Candidate] = {}

    def lines(self, decision: DecisionRecord) -> Iterator[str]:
        """What to print for the next decision."""
        candidates = {**self._pending, **{c.number: c for c in decision.activated}}
        for dropped in decision.obviated:
            candidates.pop(dropped.number, None)
        chosen = decision.chosen
        yield from cycle_lines(decision, _rank(candidates.values(), chosen))
        gone = chosen.number if chosen is not None and decision.asks is None else None
        self._pending = {number: c for number, c in candidates.items() if number != gone}


def cycle_lines(decision: DecisionRecord, candidates: Iterable[Candidate]) -> Iterator[str]:
    """One cycle; the candidates are those among which was chosen."""
    yield f"cycle {decision.cycle}, focus {decision.focus}"
    yield from (_change_line("observed", change) for change in decision.observed)
    outside = {change.ref for change in decision.observed}
    if inside := [ref for ref in decision.seen if ref not in outside]:
        yield f"  sees      {', '.join(inside)}"
    yield from (f"  drops     {_describe(c)}: {c.reason}" for c in decision.obviated)
    yield from (_candidate_line(c, decision) for c in candidates)
    yield from (_change_line(change.change.lower(), change) for change in decision.made)
    if decision.refused:
        yield f"  refused   {decision.refused.rstrip().splitlines()[-1]}"


def _rank(candidates: Iterable[Candidate], chosen: Candidate | None) -> list[Candidate]:
    """The chosen one first, then the best rated, then the oldest."""
    first = chosen.number if chosen else None
    return sorted(candidates, key=lambda c: (c.number != first, -c.rating, c.number))


def _candidate_line(c: Candidate, decision: DecisionRecord) -> str:
    chosen = decision.chosen is not None and c.number == decision.chosen.number
    second = decision.runner_up is not None and c.number == decision.runner_up.number
    return f"  {'chooses' if chosen else 'next' if second else 'pending':<9} {_describe(c)}, rated {c.rating:.2f}"


def _describe(c: Candidate) -> str:
    return f"{c.source} ({c.level}) on {c.trigger}"


def _change_line(word: str, change: EntryRecord) -> str:
    return f"  {word:<9} {change.ref} by {change.author}: {sentence(change)}"
