"""Turning points of a run, as the robot knew them: goals, plans, verdicts, lost and found, contacts, doors, things.

They are found while the run goes on, or read from its journal; the collisions are what only the simulator knows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from blackboard import Decision, Level, Posted, Retracted
from logs.explain.phrases import milestone_of, wrap
from logs.records import EntryRecord, Opaque
from logs.run_errors import BadInput
from logs.timeline import Mirror, Timeline, find_belief, read_time_s
from world_models import words
from world_models.entries import (
    BodyFault,
    Certificate,
    Contact,
    Difference,
    Discrepancy,
    DoorState,
    Goal,
    Hypothesis,
    Milestone,
    Obstacle,
    Outcome,
    Place,
    PlanSketch,
    Redirection,
    Resumed,
    UserReport,
)
from world_models.words import count

MAIN = (
    "refuted", "not testable", "lost", "found", "fault", "contact", "door", "thing", "differs", "resumed", "told")
"""Kinds that a short account of a run must not leave out."""
REMEMBERED = 8
"""The newest entries of a type that are looked back for."""
MARKS, NOT_VERIFIED = ("escalated", "relocalization"), ("refuted", "not testable")
"""A turning point has one of these words in its line of the journal, or is of one of these kinds."""
MAIN_KINDS: tuple[type[Any], ...] = (
    BodyFault, Contact, Difference, DoorState, Obstacle, Resumed, UserReport, Redirection)
KINDS: tuple[type[Any], ...] = (*MAIN_KINDS, Goal, PlanSketch, Certificate, Outcome)
NOTHING = "Nothing went wrong on the way: it was never lost, each milestone was verified, and there was no fault."
ENDED_EARLY = "Nothing had gone wrong when the run was cut off: what would have come of it nobody knows."
SIMULATOR, COLLISION = "simulator", "collision"
"""The kinds of what the simulator did, and of what only it knows to have been touched."""
Revision = tuple[str, Any, bool]
"""Id and value of an entry, and whether it is new."""
NameOf = Callable[[str], str]
"""Gives the name of a milestone by its id."""
Believed = Callable[[int], Hypothesis | None]
"""Gives where the robot believed to be in a cycle."""


@dataclass(frozen=True, slots=True)
class TurningPoint:
    """Something that changed the course of a run.

    Attributes:
        cycle: when.
        kind: goal, plan, a verdict, doubt, lost, found, fault, contact, door, thing, differs, resumed, told or the end.
        text: what happened, without a full stop.
        time_s: since the run began, by the body's clock: the newest time of any observation by then;
            None where nothing had, or in the results of older versions.
    """

    cycle: int
    kind: str
    text: str
    time_s: float | None = None

    @property
    def is_main(self) -> bool:
        """Whether a short account of the run must not leave it out."""
        return self.kind in MAIN


def at(cycle: int, time_s: float | None) -> str:
    """``cycle 360     63.9 s``, as a line of text begins."""
    return f"cycle {cycle}" + ("" if time_s is None else f"  {time_s:7.1f} s")


@dataclass(frozen=True, slots=True)
class Collision:
    """A collision, by the truth.

    Attributes:
        cycle: the first that began after it.
        locale: where the robot was, "" outside all locales; x_m, y_m: in the frame of the locale, else of the world.
        speed_m_per_s: how fast it moved; None in the results of older versions.
        thing: what it touched; "" where nobody knows.
    """

    cycle: int
    locale: str
    x_m: float
    y_m: float
    speed_m_per_s: float | None = None
    thing: str = ""

    def turning_point(self) -> TurningPoint:
        """As a turning point, which the robot knows nothing of. Raises TypeError, ValueError for other values."""
        place = Place(self.locale, float(self.x_m), float(self.y_m)).words()
        speed = "" if self.speed_m_per_s is None else f" at {self.speed_m_per_s:.2f} m/s"
        touched = f"{self.thing or 'something'}, at {place}{speed}, as only the simulator knows"
        return TurningPoint(self.cycle, COLLISION, touched)


@dataclass(frozen=True, slots=True)
class Happening:
    """What the simulator did to the robot or its building, in words; ``cycle``: the first that began after it."""

    cycle: int
    what: str

    def turning_point(self) -> TurningPoint:
        """As a turning point, which the robot knows nothing of. Raises TypeError for what is no text."""
        return TurningPoint(self.cycle, SIMULATOR, self.what + ", as only the simulator knows")


class TurningPointFinder:
    """Follows the decisions of a run."""

    def __init__(self) -> None:
        self._mirror = Mirror(REMEMBERED)
        self._states: dict[str, str] = {}
        self._time_s: float | None = None

    def find(self, decision: Decision) -> list[TurningPoint]:
        """The turning points of the next decision."""
        before, changes = find_belief(self._mirror), (*decision.observed, *decision.made)
        self._mirror.take(*changes)
        belief = find_belief(self._mirror) or before
        times = [read_time_s(partial(_get, change.entry.value)) for change in decision.observed]
        self._time_s = max((time_s for time_s in times if time_s is not None), default=self._time_s)
        revisions = [(change.entry.id, change.entry.value, isinstance(change, Posted)) for change in changes
                     if not isinstance(change, Retracted)]
        found = _turns(revisions, decision.cycle, self._name, lambda _: belief and belief.value, self._states)
        return [replace(point, time_s=self._time_s) for point in found]

    def _name(self, id: str) -> str:
        entry = self._mirror.get(id)
        return entry.value.name() if entry is not None and isinstance(entry.value, Milestone) else id


def _get(value: Any, name: str) -> Any:
    return getattr(value, name, None)


def is_adjusted(sketch: PlanSketch, author: str) -> bool:
    """Whether with this revision the rest of a plan was moved to fit the pose of a milestone."""
    return sketch.adjustments > 0 and sketch.verified and author == "milestone_passer"


def is_lost(value: Discrepancy) -> bool:
    """Whether with it nobody below the goal level could correct where the robot believed to be."""
    return value.status == "escalated" and value.level.above is Level.GOAL


def is_found(value: Hypothesis) -> bool:
    """Whether with it the robot knew again where it was."""
    return value.is_held and value.basis == "relocalization"


def _turns(
    revisions: Iterable[Revision], cycle: int, name_of: NameOf, believed: Believed, states: dict[str, str]
) -> Iterator[TurningPoint]:
    """The turning points among what a cycle wrote; of doors and things it is noted how they were before."""
    for id, value, is_new in revisions:
        yield from _turn(value, is_new, cycle, name_of, believed, states.get(id, ""))
        if isinstance(value, Obstacle | DoorState):
            states[id] = value.status if isinstance(value, Obstacle) else value.state
        elif isinstance(value, Difference):
            states[id] = _taken_for(value) or states.get(id, "")


def _taken_for(value: Difference) -> str:
    """The rival that is likelier than all others together, and whether that is sure."""
    return "" if value.leader.p < 0.5 else f"{'surely ' * value.is_sure}{value.leader.kind}"


def _is_decided(value: Difference, was: str) -> bool:
    """Whether a rival becomes sure, or another one leads than before. That something stands there its thing tells, and
    that all rather is as expected only what was sure before.
    """
    now = _taken_for(value)
    leads_anew = was != "" and now != "" and now.removeprefix("surely ") != was.removeprefix("surely ")
    leads_anew &= not now.endswith("chance") or was.startswith("surely ")
    return leads_anew or (value.is_sure and now != was and value.leader.kind != "thing")


def _turn(
    value: Any, is_new: bool, cycle: int, name_of: NameOf, believed: Believed, was: str
) -> Iterator[TurningPoint]:
    """The turning point that a new revision is, if it is one; ``was``: the state of the thing or door before."""
    if isinstance(value, Goal) and (is_new or not value.is_active):
        yield TurningPoint(cycle, "goal", f"{value.destination.locale}{'' if is_new else ': ' + value.status}")
    elif isinstance(value, PlanSketch) and is_new:
        yield TurningPoint(cycle, "plan", f"{value.where()}, {count(len(value.subgoals), 'part')}")
    elif isinstance(value, Certificate):
        said = f"{words.metres(value.deviation_m)} off" if value.verdict == "verified" else value.reason
        yield TurningPoint(cycle, value.verdict, f"{name_of(value.milestone)}: {said}")
    elif isinstance(value, Discrepancy) and value.status == "escalated":
        belief = believed(cycle) if is_lost(value) else None
        where = "" if belief is None else f"{belief.place()} by its belief; "
        yield TurningPoint(cycle, "lost" if is_lost(value) else "doubt", f"{where}{value.what}")
    elif isinstance(value, Hypothesis) and is_found(value):
        yield TurningPoint(cycle, "found", f"{value.place()}; {value.evidence or 'it knows again where it is'}")
    elif isinstance(value, BodyFault):
        yield TurningPoint(cycle, "fault", f"{value.part}: {value.what}{'' if value.is_open else ', over'}")
    elif isinstance(value, Contact):
        belief = believed(cycle)
        where = "" if belief is None else f", at {belief.place()} by its belief"
        yield TurningPoint(cycle, "contact", f"{words.brief(value)}{where}")
    elif isinstance(value, DoorState) and value.is_passable is (was == "shut"):
        yield TurningPoint(cycle, "door", words.brief(value))
    elif isinstance(value, Obstacle) and value.is_there is not (was == "there"):
        yield TurningPoint(cycle, "thing", words.brief(value))
    elif isinstance(value, Difference) and _is_decided(value, was):
        yield TurningPoint(cycle, "differs", f"{value.about}: {value.odds_in_words()}")
    elif isinstance(value, Resumed):
        yield TurningPoint(cycle, "resumed", f"after cycle {value.after_cycle}, where the run was cut off")
    elif isinstance(value, UserReport | Redirection) and value.answer:
        said = f"{value.what} is {value.state}" if isinstance(value, UserReport) else value.asked
        yield TurningPoint(cycle, "told", f"{said}; {value.answer}")
    elif isinstance(value, Outcome):
        yield TurningPoint(cycle, "the end", f"{value.kind}: {value.reason}")


def read_turning_points(history: Timeline, *, main: bool = False) -> Iterator[TurningPoint]:
    """What :class:`TurningPointFinder` finds, from those entries only that may be one.

    Entries of another version are passed over.

    Args:
        main: only those that a short account must not leave out; of a long run they are read much faster.
    """
    marks, kinds = ((*MARKS, *NOT_VERIFIED), MAIN_KINDS) if main else (MARKS, KINDS)
    cycles = {decision.cycle for mark in marks for decision in history.naming(mark)}
    cycles |= {record.cycle for record in history.of_kind(*kinds)}
    states: dict[str, str] = {}

    def name_of(id: str) -> str:
        record = history.entry(history.newest.get(id, ""))
        return id if record is None or record.kind is not Milestone else milestone_of(record)

    for cycle in sorted(cycles):
        records = filter(may_turn, history.decision(cycle).changes)
        revisions = [(one.id, value, one.is_new) for one in records if (value := _value(one)) is not None]
        found = _turns(revisions, cycle, name_of, lambda then: _value(history.held(then)), states)
        yield from (replace(point, time_s=history.time_at(cycle)) for point in found if point.is_main or not main)


def may_turn(record: EntryRecord[Any]) -> bool:
    """Whether a record can be a turning point, as far as is seen without decoding it."""
    if record.kind is Discrepancy:
        return not record.is_gone and record.field("status") == "escalated"
    if record.kind is Hypothesis:
        return not record.is_gone and record.field("basis") == "relocalization"
    return not record.is_gone and record.kind in KINDS


def _value(record: EntryRecord[Any] | None) -> Any:
    """None for one of another version, or of a kind that is not known here."""
    try:
        return None if record is None or record.kind is Opaque else record.value
    except BadInput:
        return None


def read_truth(history: Timeline, result: Mapping[str, Any]) -> Iterator[TurningPoint]:
    """What the simulator did, and where the robot truly touched something, as ``result.json`` says.

    Raises BadInput where that is malformed.
    """
    for key, kind, of_each in (("happened", Happening, "words"), ("contacts", Collision, "a place")):
        for record in result.get(key) or ():
            try:
                point = kind(**record).turning_point()
                is_known = history.cycle_of(point.cycle) is not None
            except (TypeError, ValueError):
                is_known = False
            if not is_known:
                have = f"a cycle of the journal, 1 to {len(history.cycles)},"
                raise BadInput(f"result.json: {key}: expected {have} and {of_each}, got {record!r}")
            yield replace(point, time_s=history.time_at(point.cycle))


def read_trouble(history: Timeline, result: Mapping[str, Any]) -> list[TurningPoint]:
    """What a short account must not leave out: of what the simulator alone knows, and of what the robot knew."""
    main = read_turning_points(history, main=True)
    return sorted([*read_truth(history, result), *main], key=lambda point: point.cycle)


def turn_lines(history: Timeline, result: Mapping[str, Any], *, is_whole: bool = True) -> Iterator[str]:
    """Those turning points that a short account must not leave out, and what only the simulator knows, a line each.

    ``is_whole``: the run has an outcome.
    """
    points = read_trouble(history, result)
    unplaced = (result.get("collisions") or 0) - sum(point.kind == COLLISION for point in points)
    if not points and unplaced <= 0:
        yield NOTHING if is_whole else ENDED_EARLY
        return
    yield "On the way:"
    heads, kinds = [at(point.cycle, point.time_s) for point in points], [point.kind for point in points]
    width, kind = (max(map(len, column), default=0) for column in (heads, kinds))
    yield from (wrap(p.text, f"  {head:<{width}}  {p.kind:<{kind}}  ") for head, p in zip(heads, points, strict=True))
    if unplaced > 0:
        yield f"  {count(unplaced, 'collision')}; this run does not say where"
