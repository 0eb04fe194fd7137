"""The story of an entry: the one chain from it down to pixels, model and goal that a person would tell.

Everything that an entry rests on is a graph; told whole it is long. A story follows the main reasons only, tells each
kind of thing once, at the place nearest to what is explained, and says by name from which entries each sentence comes.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from blackboard.change import Quiescence
from blackboard.servoing import Discrepancy
from logs.errors import BadInput
from logs.explain import model, phrases
from logs.explain.model import WorldFile, tell_source
from logs.explain.phrases import STRANGE, capital, describe_decision, sentence, tell_answer, wrap
from logs.records import EntryRecord
from logs.timeline import Timeline
from world_models import words
from world_models.building.locale_frame import FrameRequest, LocaleFrame
from world_models.entries.body import (
    BodyFault,
    Course,
    Frame,
    Look,
    MotionReport,
    MotorCommand,
    Recovery,
    Ride,
    RideReport,
)
from world_models.entries.door_state import DoorState
from world_models.entries.floor import FloorAppearance, FloorView, FreeFloor
from world_models.entries.location import Hypothesis, Travel
from world_models.entries.obstacle import Contact, Obstacle, Obstruction, Ranges
from world_models.entries.percepts import LineMatch, Panorama, PoseFix, Segments, Tracks
from world_models.entries.robot import CameraState, Drift, Footprint, Wheels
from world_models.entries.task import Certificate, Command, Goal, Leg, Milestone, Outcome, PlanSketch, Resumed
from world_models.entries.told import Redirection, Told

MOST = 24
"""So many things are told at the most."""
MOST_PLAIN, MOST_MET = 12, 200


@dataclass(frozen=True, slots=True)
class Step:
    """One sentence or two of a story.

    Attributes:
        label: what it is about, in a word or two.
        text: the sentences.
        refs: the entries that say so.
    """

    label: str
    text: str
    refs: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Story:
    """Why an entry came about.

    Attributes:
        ref: the entry.
        headline: what it is; of a motion the whole chain in one sentence.
        decided: who decided it, when, against what.
        steps: the reasons, from the entry downward.
    """

    ref: str
    headline: str
    decided: str
    steps: tuple[Step, ...]


LEGEND = """\
Places are in metres in each room's own frame, headings counter-clockwise from its x axis; pixels count right and
down from the top left. Model lines are edges that the map of the building says can be seen. Names in brackets are
entries of the journal: ask on with harvey why RUN NAME, and of a landmark, door or room by its name too."""


def tell_stories(history: Timeline, refs: Iterable[str], world: WorldFile | None = None) -> Iterator[Story]:
    """The story of each of some entries. Raises BadInput where the journal does not say how one came about."""
    for ref in refs:
        record = history.entry(ref)
        if record is None:
            history.verify()
            raise BadInput(f"{history.source}: expected {ref} in the journal, which does not say how it came about")
        yield story(history, record, world)


def story(history: Timeline, record: EntryRecord[Any], world: WorldFile | None = None) -> Story:
    """The story of one entry; where values have other fields than those known here, told by the entries as they are.

    Args:
        world: tells from which file and line model lines come; None where that is not asked for.
    """
    teller = _Teller(history, world)
    try:
        steps = [*teller.own(record), *teller.reasons(record), *teller.used(record), *teller.context(record)]
        head = phrases.in_one_sentence(history, record) or headline(record)
    except STRANGE:
        steps, head = list(_plain_steps(history, record)), _plainly(history, record)
    return Story(record.ref, head, describe_decision(history, record), tuple(steps))


def _plain_steps(history: Timeline, record: EntryRecord[Any]) -> Iterator[Step]:
    """The entries nearest below, each in its own sentence."""
    for below in itertools.islice(history.within(record), 1, MOST_PLAIN):
        yield Step(LABELS.get(below.kind, below.type), _plainly(history, below), (below.ref,))


def headline(record: EntryRecord[Any]) -> str:
    """What the entry is, as something that Harvey did where it is an act."""
    said = sentence(record)
    if record.kind in (MotorCommand, Course):
        return f"Harvey was told to {said}."
    if record.kind in (Told, Redirection):
        return _describe_telling(record)
    if record.kind is Look:
        return f"A picture was taken {words.purpose(record.value.purpose)}."
    if record.kind is Hypothesis and record.value.is_held:
        return _describe_belief(record.value)
    return f"{capital(said)}." if said else record.ref


def _describe_telling(record: EntryRecord[Any]) -> str:
    return f"It {sentence(record)}."


def _describe_belief(hypothesis: Hypothesis) -> str:
    if hypothesis.basis == "relocalization":
        return f"It found out where it is: at {phrases.pose(hypothesis)}."
    return f"It believed that it stood at {phrases.pose(hypothesis)}."


@dataclass(slots=True)
class _Teller:
    """Tells steps; ``told`` are the keys of those that were told already, ``met`` the entries that were come to."""

    history: Timeline
    world: WorldFile | None = None
    told: set[str] = field(default_factory=set)
    met: set[str] = field(default_factory=set)

    def own(self, record: EntryRecord[Any]) -> Iterator[Step]:
        """What is said of an entry itself, beside its headline."""
        if record.kind is FrameRequest:
            yield from (Step("answered", *told) for told in tell_answer(self.history, record))
        elif record.kind is LocaleFrame and self.world is not None:
            yield Step("described", tell_source(self.world, model.reference_of(record).locale), (record.ref,))

    def used(self, record: EntryRecord[Any]) -> Iterator[Step]:
        """By what the act went that made an entry."""
        yield from (Step("known", *told) for told in model.tell_used(self.history, record))

    def reasons(self, record: EntryRecord[Any]) -> Iterator[Step]:
        """What an entry rests on, below the entry itself."""
        if record.kind is Hypothesis:
            yield from self._belief(record)
        elif record.kind is Certificate:
            yield from self._certificate(record)
        elif record.kind is PoseFix:
            yield from self._tell_match(record)
        if (kinds := FOLLOW.get(record.kind)) is not None:
            named = [below for kind in kinds for below in self._below(record, kind)]
        else:
            order = [ref.rpartition("-")[0] for ref in record.because]
            named = sorted(self._below(record), key=lambda below: order.index(below.ref.rpartition("-")[0]))
        for below in named:
            yield from self._tell(below, record)
        for text, frame in model.tell_changes(self.history, record):
            if frame.ref not in self.met:
                self.met.add(frame.ref)
                yield from self._one(text, "changed", text, frame)
                yield from self.reasons(frame)

    def context(self, record: EntryRecord[Any]) -> Iterator[Step]:
        """The plan, the goal and the command that all of it serves."""
        for kind in CONTEXT:
            found = self.history.nearest(record, kind)
            if found is not None and found.id != record.id:
                key = found.id if kind in SEVERAL else found.type
                yield from self._one(key, LABELS[kind], SAY[kind](self.history, found), found)

    def _below(self, record: EntryRecord[Any], kind: type[Any] | None = None) -> Iterator[EntryRecord[Any]]:
        """What an entry rests on beside itself, of a kind or of any."""
        for ref in record.because:
            named = kind is None or ref.startswith(f"{kind.__name__}-")
            found = self.history.entry(ref) if named else None
            if found is not None and found.id != record.id:
                yield found

    def _tell(self, record: EntryRecord[Any], above: EntryRecord[Any]) -> Iterator[Step]:
        """An entry that something rests on, then what it rests on itself."""
        perhaps = record.kind is Hypothesis and record.value.status == "candidate"
        key = record.id if record.kind in SEVERAL or perhaps else record.type
        if key in self.told or record.ref in self.met or len(self.told) > MOST or len(self.met) > MOST_MET:
            return
        self.met.add(record.ref)
        if record.kind is Segments and above.kind in (MotorCommand, Look):
            frame = self.history.reason(record, Frame)
            seen = phrases.describe_segments(record.value, frame)
            text = f"It saw {seen}; where it is did not yet follow from them."
            yield from self._one(key, "seen", text, record, frame)
        elif perhaps:
            candidate = record.value
            text = f"It may have stood at {phrases.pose(candidate)} ({candidate.weight:.0%})."
            yield from self._one(key, "thought", text, record)
            for below in self._below(record, Panorama):
                yield from self._tell(below, record)
            return
        elif record.kind is Hypothesis:
            text = f"It believed that it stood at {phrases.pose(record.value)}."
            yield from self._one(key, "believed", text, record)
        elif record.kind not in FOLDED:
            say = SAY.get(record.kind, _plainly)
            yield from self._one(key, LABELS.get(record.kind, record.type), say(self.history, record), record)
        yield from self.reasons(record)

    def _one(self, key: str, label: str, text: str, *records: EntryRecord[Any] | None) -> Iterator[Step]:
        if text and key not in self.told:
            self.told.add(key)
            yield Step(label, text, tuple(dict.fromkeys(r.ref for r in records if r is not None)))

    def _belief(self, record: EntryRecord[Any]) -> Iterator[Step]:
        """What it saw, what it had expected; what it was sure of last."""
        basis = record.value.basis
        if basis == "tracks":
            yield from self._tell_tracks(record)
        elif basis == "odometry":
            yield from self._tell_odometry(record)
        yield from self._tell_anchor(record)

    def _tell_tracks(self, record: EntryRecord[Any]) -> Iterator[Step]:
        history = self.history
        before, frame = history.reason(record, Hypothesis), history.reason(record, Frame)
        tracks = history.tracks_of(record)
        if tracks is not None:
            now = record.value
            moved = phrases.describe_belief_change(now, before.value) if before is not None else ""
            text = f"{phrases.tracking(tracks.value, frame)} {moved}".strip()
            yield from self._one("Tracks", "seen", text, tracks, frame)
        if before is not None and before.value.basis == "odometry":
            yield from self._tell_odometry(before)

    def _tell_odometry(self, record: EntryRecord[Any]) -> Iterator[Step]:
        report = self.history.reason(record, MotionReport)
        if report is not None:
            led_to = phrases.pose(record.value)
            text = f"That was expected because {phrases.wheels(report.value)}, which led to {led_to}."
            yield from self._one("MotionReport", "expected", text, record, report)

    def _tell_anchor(self, record: EntryRecord[Any]) -> Iterator[Step]:
        """What the belief began with: a milestone, finding itself anew, or what the user told."""
        anchor = self.history.anchor_of(record)
        if anchor is None:
            return
        command, certificate = self.history.reason(anchor, Command), self.history.reason(anchor, Certificate)
        begun = anchor.value
        if begun.basis == "relocalization":
            yield from self._tell_recognition(anchor)
        elif certificate is not None:
            yield from self._certificate(certificate, f"In cycle {certificate.cycle} ")
        elif command is not None:
            text = f"Where it began it was told by the user: at {phrases.pose(begun)}."
            yield from self._one("told", "told", text, anchor, command)

    def _tell_recognition(self, anchor: EntryRecord[Any]) -> Iterator[Step]:
        """It was lost, and found where it was."""
        segments, lost = self.history.reason(anchor, Segments), self.history.reason(anchor, Discrepancy)
        frame = None if segments is None else self.history.reason(segments, Frame)
        begun = anchor.value
        found = f"; {begun.evidence}" if begun.evidence else ""
        text = (f"It found out anew where it was, in cycle {anchor.cycle}, from {phrases.picture(frame)}: at"
                f" {phrases.pose(begun)}{found}.")
        yield from self._one("recognized", "recognized", text, anchor, segments, frame)
        if lost is not None:
            yield from self._tell(lost, anchor)

    def _certificate(self, record: EntryRecord[Any], when: str = "") -> Iterator[Step]:
        history = self.history
        fix, milestone = history.reason(record, PoseFix), history.reason(record, Milestone)
        judged = None if milestone is None else milestone.value
        said = capital(when + phrases.verdict(record.value, judged))
        yield from self._one(record.id, "checked", said, record, milestone)
        if fix is not None:
            yield from self._tell_match(fix)

    def _tell_match(self, fix: EntryRecord[Any]) -> Iterator[Step]:
        """From pixels and model to a pose."""
        match = self.history.reason(fix, LineMatch)
        segments = None if match is None else self.history.reason(match, Segments)
        yield from self._one(fix.id, "matched", phrases.describe_line_match(self.history, fix), fix, match, segments)
        for text, refs in model.tell_model_lines(self.history, fix, self.world):
            if text not in self.told:
                self.told.add(text)
                yield Step("model", text, refs)


def _plainly(_history: Timeline, record: EntryRecord[Any]) -> str:
    return f"{capital(sentence(record))}."


def _line(history: Timeline, record: EntryRecord[Any]) -> str:
    sketch = history.nearest(record, PlanSketch)
    leg = record.value
    return phrases.line(leg, sketch.value if sketch is not None and sketch.id == leg.sketch else None)


SAY: Mapping[type[Any], Callable[[Timeline, EntryRecord[Any]], str]] = {
    Leg: _line,
    Milestone: lambda _, r: phrases.expectation(r.value),
    Discrepancy: lambda _, r: phrases.doubt(r.value),
    PlanSketch: lambda _, r: phrases.plan(r.value),
    Goal: lambda _, r: phrases.goal(r.value),
    Told: lambda _, r: _describe_telling(r),
    Redirection: lambda _, r: _describe_telling(r),
    Command: lambda _, r: f"The user asked for it: {r.value.text}.",
}
LABELS: Mapping[type[Any], str] = {
    Leg: "driving", Milestone: "looked for", Discrepancy: "doubted", PlanSketch: "plan", Goal: "goal",
    Command: "command", Tracks: "seen", Frame: "picture", MotionReport: "wheels", MotorCommand: "motion",
    Course: "motion",
    Look: "look", Segments: "seen", Panorama: "thought", BodyFault: "fault", Recovery: "recovery",
    Ride: "ride", RideReport: "ride", Obstruction: "hidden", Quiescence: "stillness", Outcome: "the end",
    Resumed: "resumed", Drift: "wheels", Travel: "wheels", LocaleFrame: "known", FrameRequest: "asked",
    CameraState: "camera",
    Wheels: "wheels", Footprint: "body", Contact: "touched", Ranges: "ranges", Told: "told",
    Redirection: "told",
    FreeFloor: "floor", FloorView: "floor", FloorAppearance: "floor", Obstacle: "in the way",
    DoorState: "door",
}
CONTEXT: tuple[type[Any], ...] = (PlanSketch, Goal, Command)
"""What all of it serves."""
FOLDED = frozenset({PoseFix, LineMatch, Segments, Certificate})
"""Told by the sentences of what rests on them."""
SEVERAL = frozenset({Discrepancy, Goal, PlanSketch, BodyFault})
"""Of these a story may tell more than one."""
FOLLOW: Mapping[type[Any], tuple[type[Any], ...]] = {
    MotorCommand: (Leg, Milestone, Segments, Panorama, Discrepancy, Hypothesis),
    Panorama: (Obstruction, Panorama),
    Course: (Leg, Discrepancy, Hypothesis),
    Leg: (Hypothesis,),
    Milestone: (Obstruction, Certificate, Discrepancy, Hypothesis),
    Certificate: (Milestone,),
    PoseFix: (LineMatch,),
    LineMatch: (Segments, Milestone),
    Segments: (Frame, Milestone),
    Tracks: (Frame, Hypothesis),
    Hypothesis: (BodyFault,),
    Discrepancy: (Discrepancy, BodyFault, Contact, Certificate, Hypothesis, MotionReport),
    Goal: (Redirection, PlanSketch, Hypothesis),
    PlanSketch: (Milestone, Leg, PlanSketch, Hypothesis),
    Look: (Milestone, Discrepancy, Segments, Hypothesis),
    Frame: (Look, Course),
    MotionReport: (MotorCommand, Course),
    Contact: (MotorCommand, Course),
    Ride: (PlanSketch, Hypothesis),
    RideReport: (Ride,),
    LocaleFrame: (Told, FrameRequest),
}
"""Which reasons a story follows, in which order; of a type that is not named here, all."""


def lines_of(told: Story) -> Iterator[str]:
    """A story as paragraphs: label, sentences and the entries that say so."""
    yield wrap(f"{told.headline}  [{told.ref}]" if told.ref else told.headline)
    if told.decided:
        yield wrap(told.decided)
    width = max((len(step.label) for step in told.steps), default=0)
    for step in told.steps:
        named = f"  [{', '.join(step.refs)}]" if step.refs else ""
        yield wrap(step.text + named, f"  {step.label.ljust(width)}  ")
