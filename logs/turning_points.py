"""Turning points of a run, as the robot knew them: goals, plans, verdicts, lost and found, contacts, doors, things."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from blackboard.change import Change, Posted, Retracted
from blackboard.entry import Entry
from blackboard.journal import Decision
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from logs.recording.board_mirror import Mirror
from world_models import words
from world_models.entries.body import BodyFault, Recovery
from world_models.entries.door_state import DoorState
from world_models.entries.location import Hypothesis
from world_models.entries.obstacle import Obstacle
from world_models.entries.task import Certificate, Goal, Milestone, Outcome, PlanSketch, Resumed
from world_models.entries.told import Redirection, Told
from world_models.entries.touch import Contact

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


class TurningPointFinder:
    """Follows the decisions of a run."""

    def __init__(self) -> None:
        self._mirror = Mirror(REMEMBERED)
        self._states: dict[str, str] = {}
        self._time_s: float | None = None

    def find(self, decision: Decision) -> list[TurningPoint]:
        """The turning points of the next decision."""
        points: list[TurningPoint] = []
        before = self._mirror.latest(Hypothesis, _is_held)
        changes = (*decision.observed, *decision.made)
        for change in changes:
            self._mirror.take(change)
        times = [when for change in decision.observed if (when := time_of(change.entry.value)) is not None]
        self._time_s = max(times, default=self._time_s)
        now = self._mirror.latest(Hypothesis, _is_held)
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


def _is_held(value: Hypothesis) -> bool:
    return value.is_held
