"""Does every decision rest on something? The walk from a decision to a goal, a model element or a sensor frame."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from harvey.run_files.records import DecisionRecord, EntryRecord
from harvey.why.history import History

GOAL, MODEL, SENSOR = "goal", "model", "sensor"
KINDS = (GOAL, MODEL, SENSOR)
"""What an explanation may end in: what was asked for, what is known of building and robot, what the camera saw."""
KNOWN = frozenset({"LocaleFrame", "CameraState", "Wheels", "Footprint", "Told", "Redirection"})
"""The kinds of entries that are a part of the model, and what the robot is told of it."""
Kind = Callable[[EntryRecord], str | None]


@dataclass(frozen=True, slots=True)
class Grounds:
    """What some entries rest on.

    Attributes:
        kinds: which of KINDS they reach, in that order.
        lacking: reasons of which the journal says nothing.
    """

    kinds: tuple[str, ...]
    lacking: tuple[str, ...] = ()

    @property
    def hold(self) -> bool:
        """Whether there is something at the bottom, and no step of the way is missing."""
        return bool(self.kinds) and not self.lacking


@dataclass(frozen=True, slots=True)
class Accounted:
    """A decision, what it is to be explained by, and what each of these rests on."""

    decision: DecisionRecord
    grounds: Mapping[str, Grounds]

    @property
    def holds(self) -> bool:
        """Whether everything that it did rests on something; so it does where nothing was decided."""
        return all(grounds.hold for grounds in self.grounds.values())


def kind_of(record: EntryRecord) -> str | None:
    """The kind of ground that an entry is itself; None where it is none."""
    value = record.value if isinstance(record.value, dict) else {}
    if record.type in ("Command", "Goal"):
        return GOAL
    if record.type == "Frame":
        return SENSOR
    if record.type in KNOWN:
        return MODEL
    return MODEL if _names_the_model(record.type, value) else None


def _names_the_model(type: str, value: Mapping[str, Any]) -> bool:
    if type == "Milestone":
        return bool(value.get("landmarks"))
    if type == "Tracks":
        return bool(value.get("items"))
    return type == "PlanSketch" and bool(value.get("subgoals"))


def reaches(entry: Callable[[str], EntryRecord | None], refs: Iterable[str], kind_of: Kind = kind_of) -> Grounds:
    """What some entries rest on, by walking ``because`` as far as it leads; each entry is looked at once."""
    todo, known = list(refs), set[str]()
    kinds: set[str] = set()
    lacking: list[str] = []
    while todo:
        ref = todo.pop()
        if ref in known:
            continue
        known.add(ref)
        record = entry(ref)
        if record is None:
            lacking.append(ref)
            continue
        if (kind := kind_of(record)) is not None:
            kinds.add(kind)
        todo += record.because
    return Grounds(tuple(k for k in KINDS if k in kinds), tuple(sorted(lacking)))


def explained_by(decision: DecisionRecord) -> tuple[str, ...]:
    """The entries that a decision is explained by.

    What it made; where it made nothing (it was refused), what woke the knowledge source; where nobody acted, what
    woke those that were dropped. Nothing where nothing was decided.
    """
    if decision.made:
        return tuple(dict.fromkeys(ref for r in decision.made for ref in r.retracted_because or (r.ref,)))
    if decision.chosen is not None:
        return (decision.chosen.trigger,)
    return tuple(dict.fromkeys(c.trigger for c in decision.obviated))


def trace_grounds(decisions: Iterable[DecisionRecord], kind_of: Kind = kind_of) -> Iterator[Accounted]:
    """Each decision of a run with what it rests on; reasons are older than what rests on them, so one pass does."""
    known: dict[str, Grounds] = {}
    for decision in decisions:
        for record in (*decision.observed, *decision.made):
            if record.change != "Retracted" or record.ref not in known:
                known[record.ref] = _together(record, known, kind_of(record))
        refs = explained_by(decision)
        yield Accounted(decision, {ref: known.get(ref, Grounds((), (ref,))) for ref in refs})


def _together(record: EntryRecord, known: Mapping[str, Grounds], own: str | None) -> Grounds:
    below = [known.get(ref, Grounds((), (ref,))) for ref in record.because]
    kinds = {kind for grounds in below for kind in grounds.kinds} | {own}
    lacking = sorted({ref for grounds in below for ref in grounds.lacking})
    return Grounds(tuple(k for k in KINDS if k in kinds), tuple(lacking))


def ground_names() -> tuple[str, ...]:
    """The kinds of grounds in words, as those who reach them."""
    return "reach the goal", "the model", "a camera frame"


@dataclass(frozen=True, slots=True)
class Check:
    """How many decisions of a run rest on something.

    Attributes:
        decisions: all cycles; acts: those in which somebody was chosen.
        reached: how many rest on something.
        by_kind: how many reach each of KINDS.
        failing: those that do not.
    """

    decisions: int
    acts: int
    reached: int
    by_kind: Mapping[str, int]
    failing: tuple[Accounted, ...]


def check(history: History) -> Check:
    """Every decision of a run. Raises BadInput where a line of its journal is malformed."""
    decisions = acts = reached = 0
    by_kind = dict.fromkeys(KINDS, 0)
    failing: list[Accounted] = []
    for one in trace_grounds(history.decisions()):
        decisions += 1
        acts += one.decision.chosen is not None
        reached += one.holds
        for kind in sorted({kind for grounds in one.grounds.values() for kind in grounds.kinds}):
            by_kind[kind] += 1
        if not one.holds:
            failing.append(one)
    return Check(decisions, acts, reached, by_kind, tuple(failing))
