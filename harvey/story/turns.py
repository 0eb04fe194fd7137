"""The turning points of a run, read from its journal; and the collisions, which only the simulator knows."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Mapping
from dataclasses import replace
from textwrap import fill
from typing import Any

from blackboard.change import Posted, Revised
from blackboard.entry import Entry
from harvey.errors import BadInput
from harvey.run_files.observations import entry_of
from harvey.run_files.records import EntryRecord
from harvey.runner.result import Contact
from harvey.why.decisions import time_at
from harvey.why.history import History
from harvey.why.sentences import kinds_for
from logs.turning_points import TurningPoint, state_of, turning_points
from world_models.entries.location import Hypothesis, Place
from world_models.words import count

MARKS = ("escalated", "relocalization")
"""A turning point has one of these words in its line of the journal, or is of one of these kinds."""
TOLD_KINDS = ("BodyFault", "Contact", "DoorState", "Obstacle", "Resumed", "Told", "Redirection")
KINDS = (*TOLD_KINDS, "Goal", "PlanSketch", "Certificate", "Outcome")
NOT_VERIFIED = ("refuted", "not testable")
WIDTH = 120
NOTHING = "Nothing went wrong on the way: it was never lost, each milestone was verified, and there was no fault."


def read_turning_points(history: History, *, told: bool = False) -> Iterator[TurningPoint]:
    """What :class:`~logs.turning_points.TurningPointFinder` finds, from those entries only that may be one.

    Entries of another version are passed over.

    Args:
        told: only those that a short account must not leave out; of a long run they are read much faster.
    """
    marks, kinds = ((*MARKS, *NOT_VERIFIED), TOLD_KINDS) if told else (MARKS, KINDS)
    cycles = {decision.cycle for mark in marks for decision in history.naming(mark)}
    cycles |= {record.cycle for record in history.of_kind(*kinds)}
    beliefs = [ref for ref in history.refs if ref.startswith("Hypothesis-")]
    states: dict[str, str] = {}
    for cycle in sorted(cycles):
        decision = history.decision(cycle)
        for record in (*decision.observed, *decision.made):
            entry = _entry(record) if _may_turn(record) else None
            if entry is None:
                continue
            change = Posted(entry) if record.change == "Posted" else Revised(entry)
            was, states[record.id] = states.get(record.id, ""), state_of(entry.value)
            belief = _belief(history, beliefs, cycle) if record.type in ("Discrepancy", "Contact") else None
            for point in turning_points(change, cycle, lambda id: _newest(history, id), belief, was):
                if point.is_told or not told:
                    yield replace(point, time_s=time_at(history, cycle))


def _may_turn(record: EntryRecord) -> bool:
    """Whether a record can be a turning point, as far as is seen without decoding it."""
    if record.change == "Retracted" or not isinstance(record.value, dict):
        return False
    if record.type == "Discrepancy":
        return record.value.get("status") == "escalated"
    if record.type == "Hypothesis":
        return record.value.get("basis") == "relocalization"
    return record.type in KINDS


def read_collisions(history: History, result: Mapping[str, Any]) -> Iterator[TurningPoint]:
    """Where the robot truly touched something, as ``result.json`` says. Raises BadInput where that is malformed."""
    for record in result.get("contacts") or ():
        try:
            contact = Contact(**record)
            place = Place(contact.locale, float(contact.x_m), float(contact.y_m)).words()
            speed = "" if contact.speed_m_per_s is None else f" at {contact.speed_m_per_s:.2f} m/s"
        except (TypeError, ValueError) as error:
            raise BadInput(f"result.json: contacts: expected cycle and place of each, got {record!r}") from error
        if history.cycle_of(contact.cycle) is None:
            have = f"1 to {len(history.cycles)}"
            raise BadInput(f"result.json: contacts: expected cycles of the journal, {have}, got {contact.cycle!r}")
        text = f"{place}{speed}, as only the simulator knows"
        yield TurningPoint(contact.cycle, "collision", text, time_at(history, contact.cycle))


def turn_lines(history: History, result: Mapping[str, Any]) -> Iterator[str]:
    """Those turning points that a short account must not leave out, and the collisions, a line each."""
    told = read_turning_points(history, told=True)
    points = sorted([*told, *read_collisions(history, result)], key=lambda point: point.cycle)
    unplaced = (result.get("collisions") or 0) - sum(point.kind == "collision" for point in points)
    if not points and unplaced <= 0:
        yield NOTHING
        return
    yield "On the way:"
    heads = [f"  cycle {p.cycle}" + ("" if p.time_s is None else f"  {p.time_s:7.1f} s") for p in points]
    width, kind = max(map(len, heads), default=0), max((len(point.kind) for point in points), default=0)
    for head, point in zip(heads, points, strict=True):
        first = f"{head:<{width}}  {point.kind:<{kind}}  "
        yield fill(point.text, WIDTH, initial_indent=first, subsequent_indent=" " * len(first), break_on_hyphens=False)
    if unplaced > 0:
        yield f"  {count(unplaced, 'collision')}; this run does not say where"


def _belief(history: History, refs: list[str], cycle: int) -> Entry[Hypothesis] | None:
    """The newest belief that was held in a cycle, or until then."""
    for ref in reversed(refs[: bisect_right(refs, cycle, key=lambda ref: _cycle(history, ref))]):
        record = history.entry(ref)
        entry = None if record is None else _entry(record)
        if entry is not None and isinstance(entry.value, Hypothesis) and entry.value.is_held:
            return entry
    return None


def _cycle(history: History, ref: str) -> int:
    record = history.entry(ref)
    return 0 if record is None else record.cycle


def _newest(history: History, id: str) -> Entry[Any] | None:
    """An entry as it was last; of a milestone without its lines, which take long to decode and are not told."""
    record = history.entry(history.newest[id]) if id in history.newest else None
    if record is not None and record.type == "Milestone" and isinstance(record.value, dict):
        record = replace(record, value={k: [] if isinstance(v, list) else v for k, v in record.value.items()})
    return None if record is None else _entry(record)


def _entry(record: EntryRecord) -> Entry[Any] | None:
    try:
        return entry_of(record, kinds_for(record))
    except BadInput:
        return None
