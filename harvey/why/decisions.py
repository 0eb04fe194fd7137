"""A decision in words: by whom, when, against what, and what its act had to wait for."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Mapping

from harvey.run_files.records import WHAT_IF, Candidate, EntryRecord
from harvey.why.history import History
from harvey.why.links import words
from harvey.why.sentences import sentence
from world_models.words import listed

TIMED_WITHIN = 100
"""A time is looked for in so many decisions, backwards."""
MAX_LISTED = 4


def describe_decision(history: History, record: EntryRecord) -> str:
    """By whom, when and against what."""
    time_s = time_at(history, record.cycle)
    when = f"cycle {record.cycle}" + ("" if time_s is None else f", {time_s:.1f} s into the run,")
    if record.author == WHAT_IF:
        return f"It was revised in {when.rstrip(',')} by the question what if."
    if record.observed:
        return f"It came from outside, from {record.author}, and was taken up in {when.rstrip(',')}."
    decision = history.decision(record.cycle)
    text = f"Decided in {when} by the {words(record.author)}"
    if decision.chosen is None:
        return text + "."
    asked = tell_questions(history, record)
    next_best = decision.runner_up
    second = f"; next best was {describe_candidate(next_best)}" if next_best else "; nobody else could act"
    return f"{text}, woken by {decision.chosen.trigger}, rated {decision.chosen.rating:.2f}{second}.{asked}"


def describe_candidate(c: Candidate) -> str:
    return f"the {words(c.source)}, rated {c.rating:.2f}"


def time_at(history: History, cycle: int) -> float | None:
    """The newest time that anything from outside had told by a cycle [s]; None where nothing had lately."""
    cycles = history.cycles
    for one in reversed(cycles[: bisect_right(cycles, cycle)][-TIMED_WITHIN:]):
        told = [found for found in map(_time_of, history.decision(one).observed) if found is not None]
        if told:
            return max(told)
    return None


def _time_of(record: EntryRecord) -> float | None:
    if not isinstance(record.value, Mapping):
        return None
    value = record.value.get("sim_time_s", record.value.get("when_s"))
    since, waited = record.value.get("since_s"), record.value.get("waited_s")
    if isinstance(since, int | float) and isinstance(waited, int | float):
        value = since + waited
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None


def tell_questions(history: History, record: EntryRecord) -> str:
    """What the act that made an entry had asked for before it came again; "" where it lacked nothing."""
    chosen = history.decision(record.cycle).chosen
    if record.observed or chosen is None or chosen.since == record.cycle:
        return ""
    asked: list[EntryRecord] = []
    for ref in history.refs:
        request = history.entry(ref) if ref.startswith("FrameRequest-") and ref.endswith(".0") else None
        if request is None or not chosen.since <= request.cycle < record.cycle:
            continue
        before = history.decision(request.cycle).chosen
        if before is not None and before.number == chosen.number:
            asked.append(request)
    if not asked:
        return ""
    wanted = listed([f"{sentence(request).removeprefix('asks ')} ({request.ref})" for request in asked], MAX_LISTED)
    return f" It had waited for an answer first: it asked for {wanted}."


def tell_answer(history: History, request: EntryRecord) -> Iterator[tuple[str, tuple[str, ...]]]:
    """What became of the act that asked."""
    asked = history.entry(f"{request.id}.0") or request
    decision = history.decision(asked.cycle)
    if decision.chosen is None:
        return
    for later in history.naming(decision.chosen.trigger):
        if later.cycle <= asked.cycle or later.chosen is None or later.chosen.number != decision.chosen.number:
            continue
        made = listed([record.ref for record in later.made], MAX_LISTED) or "nothing"
        text = f"The act waited for the answer, and came again in cycle {later.cycle}: it made {made}."
        yield text, tuple(record.ref for record in later.made[:MAX_LISTED])
        return
