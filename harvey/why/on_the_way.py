"""What happened on the way: when and where the robot was lost and found, what was refuted, faults, contacts."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from textwrap import fill
from typing import Any

from blackboard.change import Posted, Revised
from blackboard.entry import Entry
from harvey.errors import BadInput
from harvey.run_files.observations import entry_of
from harvey.run_files.records import EntryRecord
from harvey.run_files.run_directory import RunDirectory
from harvey.why.history import History
from harvey.why.links import nearest
from harvey.why.sentences import kinds_for
from logs.turning_points import TurningPoint, turning_points
from world_models.entries.location import Place
from world_models.words import count

MARKS = ("escalated", "refuted", "not testable", "relocalization")
"""A turning point that must be told has one of these words in its line of the journal, or is of one of these kinds."""
KINDS = ("BodyFault-", "Contact-", "Resumed-", "Told-")
WIDTH = 120
WITHOUT: Mapping[str, str] = {
    "action": "no landmark was followed, and it drove by dead reckoning between milestones",
    "plan": "no pose was taken over from a milestone",
    "goal": "a robot that is lost does not look for where it is",
}
"""What it means that a level is off."""


def levels_off(run: RunDirectory) -> Iterator[str]:
    """Which servo levels were switched off, as run.json says; nothing where it does not."""
    try:
        head = json.loads((run.path / "run.json").read_text(encoding="utf-8"))
        servo = {**head["servo"], **{key.removeprefix("servo."): value == "on" for key, value in head["constants"]
                                     if key.startswith("servo.")}}
    except (OSError, ValueError, KeyError, TypeError):
        return
    for level, is_on in servo.items():
        if is_on is False:
            yield f"The {level} level of servoing was off in this run: {WITHOUT.get(level, 'nobody closed it')}."


def on_the_way(history: History, result: Mapping[str, Any]) -> Iterator[str]:
    """The turning points of a run, a line each.

    Args:
        result: what ``result.json`` holds: only the simulator knows of collisions.
    """
    points = sorted([*read_turning_points(history), *_collisions(result)], key=lambda point: point.cycle)
    unplaced = (result.get("collisions") or 0) - sum(point.kind == "collision" for point in points)
    if not points and unplaced <= 0:
        yield "Nothing went wrong on the way: it was never lost, each milestone was verified, and there was no fault."
        return
    yield "On the way:"
    width = max((len(f"{point.cycle}{point.kind}") for point in points), default=0)
    for point in points:
        head = f"  cycle {point.cycle}  {point.kind}" + " " * (width - len(f"{point.cycle}{point.kind}")) + "  "
        yield fill(point.text, WIDTH, initial_indent=head, subsequent_indent=" " * len(head), break_on_hyphens=False)
    if unplaced > 0:
        yield f"  {count(unplaced, 'collision')}; this run does not say where"


def read_turning_points(history: History) -> Iterator[TurningPoint]:
    """The turning points that a short account must not leave out. Entries of another version are passed over."""
    cycles = {decision.cycle for mark in MARKS for decision in history.naming(mark)}
    records = (history.entry(ref) for ref in history.refs if ref.startswith(KINDS))
    cycles |= {record.cycle for record in records if record is not None}
    for cycle in sorted(cycles):
        decision = history.decision(cycle)
        for record in (*decision.observed, *decision.made):
            yield from _points(history, record, cycle)


def _points(history: History, record: EntryRecord, cycle: int) -> Iterator[TurningPoint]:
    entry = _entry(record)
    if entry is None or record.change == "Retracted":
        return
    change = Posted(entry) if record.change == "Posted" else Revised(entry)
    below = nearest(history, record, ("Hypothesis",)) if record.type == "Discrepancy" else None
    belief = None if below is None else _entry(below)
    yield from (point for point in turning_points(change, cycle, lambda id: _newest(history, id), belief)
                if point.is_told)


def _newest(history: History, id: str) -> Entry[Any] | None:
    record = history.entry(history.newest[id]) if id in history.newest else None
    return None if record is None else _entry(record)


def _entry(record: EntryRecord) -> Entry[Any] | None:
    try:
        return entry_of(record, kinds_for(record))
    except BadInput:
        return None


def _collisions(result: Mapping[str, Any]) -> Iterator[TurningPoint]:
    for contact in result.get("contacts") or ():
        place = Place(contact["locale"], contact["x_m"], contact["y_m"])
        text = f"{place.words()}, as only the simulator knows"
        yield TurningPoint(contact["cycle"], "collision", text)
