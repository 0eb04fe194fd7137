"""Turning points of a run, as the robot knew them: goals, plans, verdicts, lost and found, contacts, doors, things.

They are found while the run goes on, or read from its journal; the collisions are what only the simulator knows.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from blackboard.change import Change, Posted, Retracted, Revised
from blackboard.entry import Entry
from blackboard.journal import Decision
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from logs.errors import BadInput
from logs.explain.phrases import wrap
from logs.recording.board_mirror import Mirror, is_held
from logs.records import EntryRecord, Opaque
from logs.timeline import Timeline
from world_models import words
from world_models.entries.body import BodyFault, Recovery
from world_models.entries.door_state import DoorState
from world_models.entries.location import Hypothesis, Place
from world_models.entries.obstacle import Contact, Obstacle
from world_models.entries.task import Certificate, Goal, Milestone, Outcome, PlanSketch, Resumed
from world_models.entries.told import Redirection, Told
from world_models.words import count

TOLD = ("refuted", "not testable", "lost", "found", "fault", "contact", "door", "thing", "resumed", "told")
"""Kinds that a short account of a run must not leave out."""
IMPASSABLE = ("shut", "ajar")
"""States of a door through which no way leads."""
REMEMBERED = 8
"""The newest entries of a type that are looked back for."""

Get = Callable[[str], Entry[Any] | None]
"""Gives the current revision of an entry by its id."""


@dataclass(frozen=True, slots=True)
class TurningPoint:
    """Something that changed the course of a run.

    Attributes:
        cycle: when.
        kind: goal, plan, a verdict, doubt, lost, found, fault, contact, door, thing, resumed, told or the end.
        text: what happened, without a full stop.
        time_s: since the run began, by the body's clock: the newest time that anything from outside had told by then;
            None where nothing had, or in the results of older versions.
    """

    cycle: int
    kind: str
    text: str
    time_s: float | None = None

    @property
    def is_told(self) -> bool:
        """Whether a short account of the run must not leave it out."""
        return self.kind in TOLD


@dataclass(frozen=True, slots=True)
class Collision:
    """A collision, by the truth.

    Attributes:
        cycle: the first that began after it.
        locale: where the robot was, "" outside all locales; x_m, y_m: in the frame of the locale, else of the world.
        speed_m_per_s: how fast it moved; None in the results of older versions.
    """

    cycle: int
    locale: str
    x_m: float
    y_m: float
    speed_m_per_s: float | None = None


class TurningPointFinder:
    """Follows the decisions of a run."""

    def __init__(self) -> None:
        self._mirror = Mirror(REMEMBERED)
        self._states: dict[str, str] = {}
        self._time_s: float | None = None

    def find(self, decision: Decision) -> list[TurningPoint]:
        """The turning points of the next decision."""
        points: list[TurningPoint] = []
        before = self._mirror.latest(Hypothesis, is_held)
        changes = (*decision.observed, *decision.made)
        for change in changes:
            self._mirror.take(change)
        times = [when for change in decision.observed if (when := time_of(change.entry.value)) is not None]
        self._time_s = max(times, default=self._time_s)
        now = self._mirror.latest(Hypothesis, is_held)
        for change in changes:
            was = self._states.get(change.entry.id, "")
            if state := state_of(change.entry.value):
                self._states[change.entry.id] = state
            found = turning_points(change, decision.cycle, self._mirror.get, now or before, was)
            points += (replace(point, time_s=self._time_s) for point in found)
        return points


def state_of(value: Any) -> str:
    """Of what changes its state: a thing, as there or gone; a door, as open or shut. "" of anything else."""
    if isinstance(value, Obstacle):
        return value.status
    return value.state if isinstance(value, DoorState) else ""


def time_of(value: Any) -> float | None:
    """When an observation was made, by the body's clock [s]; None where it does not tell."""
    if isinstance(value, Recovery):
        return value.since_s + value.waited_s
    found = getattr(value, "sim_time_s", getattr(value, "when_s", None))
    return float(found) if isinstance(found, int | float) and math.isfinite(found) else None


def turning_points(
    change: Change, cycle: int, get: Get, belief: Entry[Hypothesis] | None, was: str = ""
) -> Iterator[TurningPoint]:
    """The turning point that a change is, if it is one.

    Args:
        cycle: of the decision.
        get: gives an entry by its id.
        belief: where the robot believed to be.
        was: the state of the thing or door before, by :func:`state_of`; "" where it is new.
    """
    if isinstance(change, Retracted):
        return
    value, is_new = change.entry.value, isinstance(change, Posted)
    if isinstance(value, Goal) and (is_new or not value.is_active):
        yield TurningPoint(cycle, "goal", f"{value.destination.locale}{'' if is_new else ': ' + value.status}")
    elif isinstance(value, PlanSketch) and is_new:
        yield TurningPoint(cycle, "plan", f"{value.where()}, {words.count(len(value.subgoals), 'part')}")
    elif isinstance(value, Certificate):
        yield TurningPoint(cycle, value.verdict, _verdict(value, get))
    elif isinstance(value, Discrepancy) and value.status == "escalated":
        yield _to_turning_point(value, cycle, belief)
    elif isinstance(value, Hypothesis) and value.is_held and value.basis == "relocalization":
        how = value.evidence or "it knows again where it is"
        yield TurningPoint(cycle, "found", f"{value.place()}; {how}")
    elif isinstance(value, BodyFault):
        yield TurningPoint(cycle, "fault", f"{value.part}: {value.what}{'' if value.is_open else ', over'}")
    elif isinstance(value, Contact):
        where = "" if belief is None else f", at {belief.value.place()} by its belief"
        yield TurningPoint(cycle, "contact", f"{words.brief(value)}{where}")
    elif isinstance(value, DoorState) and value.is_passable is (was in IMPASSABLE):
        yield TurningPoint(cycle, "door", words.brief(value))
    elif isinstance(value, Obstacle) and value.is_there is not (was == "there"):
        yield TurningPoint(cycle, "thing", words.brief(value))
    elif isinstance(value, Resumed):
        yield TurningPoint(cycle, "resumed", f"after cycle {value.after_cycle}, where the run was cut off")
    elif isinstance(value, Told) and value.answer:
        yield TurningPoint(cycle, "told", f"{value.what} is {value.state}; {value.answer}")
    elif isinstance(value, Redirection) and value.answer:
        yield TurningPoint(cycle, "told", f"to go elsewhere: {value.text}; {value.answer}")
    elif isinstance(value, Outcome):
        yield TurningPoint(cycle, "the end", f"{value.kind}: {value.reason}")


def _to_turning_point(discrepancy: Discrepancy, cycle: int, belief: Entry[Hypothesis] | None) -> TurningPoint:
    if discrepancy.level.above is not Level.GOAL:
        return TurningPoint(cycle, "doubt", discrepancy.what)
    where = f"{belief.value.place()} by its belief; " if belief is not None else ""
    return TurningPoint(cycle, "lost", f"{where}{discrepancy.what}")


def _verdict(certificate: Certificate, get: Get) -> str:
    entry = get(certificate.milestone)
    what = entry.value.name() if entry is not None and isinstance(entry.value, Milestone) else certificate.milestone
    if certificate.verdict == "verified":
        return f"{what}: {words.metres(certificate.deviation_m)} off"
    return f"{what}: {certificate.reason}"


MARKS = ("escalated", "relocalization")
"""A turning point has one of these words in its line of the journal, or is of one of these kinds."""
TOLD_KINDS: tuple[type[Any], ...] = (BodyFault, Contact, DoorState, Obstacle, Resumed, Told, Redirection)
KINDS: tuple[type[Any], ...] = (*TOLD_KINDS, Goal, PlanSketch, Certificate, Outcome)
NOT_VERIFIED = ("refuted", "not testable")
NOTHING = "Nothing went wrong on the way: it was never lost, each milestone was verified, and there was no fault."


def read_turning_points(history: Timeline, *, told: bool = False) -> Iterator[TurningPoint]:
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
            change = Posted(entry) if record.is_new else Revised(entry)
            was, states[record.id] = states.get(record.id, ""), state_of(entry.value)
            belief = _belief(history, beliefs, cycle) if record.kind in (Discrepancy, Contact) else None
            for point in turning_points(change, cycle, lambda id: _newest(history, id), belief, was):
                if point.is_told or not told:
                    yield replace(point, time_s=history.time_at(cycle))


def _may_turn(record: EntryRecord[Any]) -> bool:
    """Whether a record can be a turning point, as far as is seen without decoding it."""
    if record.is_gone or not isinstance(record.fields, dict):
        return False
    if record.kind is Discrepancy:
        return record.fields.get("status") == "escalated"
    if record.kind is Hypothesis:
        return record.fields.get("basis") == "relocalization"
    return record.kind in KINDS


def read_collisions(history: Timeline, result: Mapping[str, Any]) -> Iterator[TurningPoint]:
    """Where the robot truly touched something, as ``result.json`` says. Raises BadInput where that is malformed."""
    for record in result.get("contacts") or ():
        try:
            contact = Collision(**record)
            place = Place(contact.locale, float(contact.x_m), float(contact.y_m)).words()
            speed = "" if contact.speed_m_per_s is None else f" at {contact.speed_m_per_s:.2f} m/s"
        except (TypeError, ValueError) as error:
            raise BadInput(f"result.json: contacts: expected cycle and place of each, got {record!r}") from error
        if history.cycle_of(contact.cycle) is None:
            have = f"1 to {len(history.cycles)}"
            raise BadInput(f"result.json: contacts: expected cycles of the journal, {have}, got {contact.cycle!r}")
        text = f"{place}{speed}, as only the simulator knows"
        yield TurningPoint(contact.cycle, "collision", text, history.time_at(contact.cycle))


def turn_lines(history: Timeline, result: Mapping[str, Any]) -> Iterator[str]:
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
        yield wrap(point.text, f"{head:<{width}}  {point.kind:<{kind}}  ")
    if unplaced > 0:
        yield f"  {count(unplaced, 'collision')}; this run does not say where"


def _belief(history: Timeline, refs: list[str], cycle: int) -> Entry[Hypothesis] | None:
    """The newest belief that was held in a cycle, or until then."""
    for ref in reversed(refs[: bisect_right(refs, cycle, key=lambda ref: _cycle(history, ref))]):
        record = history.entry(ref)
        entry = None if record is None else _entry(record)
        if entry is not None and isinstance(entry.value, Hypothesis) and entry.value.is_held:
            return entry
    return None


def _cycle(history: Timeline, ref: str) -> int:
    record = history.entry(ref)
    return 0 if record is None else record.cycle


def _newest(history: Timeline, id: str) -> Entry[Any] | None:
    """An entry as it was last; of a milestone without its lines, which take long to decode and are not told."""
    record = history.entry(history.newest[id]) if id in history.newest else None
    if record is not None and record.kind is Milestone and isinstance(record.fields, dict):
        record = replace(record, fields={k: [] if isinstance(v, list) else v for k, v in record.fields.items()})
    return None if record is None else _entry(record)


def _entry(record: EntryRecord[Any]) -> Entry[Any] | None:
    """None for one of another version, or of a kind that is not known here."""
    try:
        return None if record.kind is Opaque else record.change_of_board.entry
    except BadInput:
        return None
