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
from logs.explain import model, phrases
from logs.explain.model import WorldFile, tell_source
from logs.explain.phrases import capital, describe_decision, named, plainly, sentence, tell_answer, wrap
from logs.records import EntryRecord, is_a
from logs.run_errors import UNREADABLE, BadInput
from logs.timeline import Timeline
from world_models import words
from world_models.building.locale_frame import FrameRequest, LocaleFrame
from world_models.entries.body import (
    BodyFault,
    CameraPicture,
    Course,
    MotionReport,
    MotorCommand,
    PictureRequest,
    Recovery,
    Ride,
    RideReport,
)
from world_models.entries.door_state import DoorState
from world_models.entries.floor import FloorAppearance, FloorView, FreeFloor
from world_models.entries.location import Hypothesis, PlaceSearch, Travel
from world_models.entries.obstacle import Contact, Obstacle, Obstruction, Ranges
from world_models.entries.percepts import LineMatch, Panorama, PoseFix, Segments, Tracks
from world_models.entries.robot_state import CameraState, Drift, Footprint, Wheels
from world_models.entries.task import Certificate, Command, Goal, Leg, Milestone, Outcome, PlanSketch, Resumed
from world_models.entries.user_reports import Redirection, UserReport

MOST, MOST_PLAIN, MOST_MET = 24, 12, 200
"""So many things are told at the most, of a run of another version, and so many entries come to."""
LEGEND = """\
Places are in metres in each room's own frame, headings counter-clockwise from its x axis; pixels count right and
down from the top left. Model lines are edges that the map of the building says can be seen. Names in brackets are
entries of the journal: ask on with harvey why RUN NAME, and of a landmark, door or room by its name too."""


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


def step(label: str, text: str, *records: EntryRecord[Any] | None) -> Step:
    """A sentence that some entries say."""
    return Step(label, text, tuple(dict.fromkeys(record.ref for record in records if record is not None)))


def story_of(
    history: Timeline, record: EntryRecord[Any], head: str, steps: Iterable[Step] = (), *, ref: str = ""
) -> Story:
    """A story under a headline of one's own; ``ref``: of what, where that is another revision."""
    return Story(ref or record.ref, head, describe_decision(history, record), tuple(steps))


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
    except UNREADABLE:
        below = itertools.islice(history.within(record), 1, MOST_PLAIN)
        steps, head = [step(label_of(one), plainly(one), one) for one in below], plainly(record)
    return story_of(history, record, head, steps)


def label_of(record: EntryRecord[Any]) -> str:
    """What an entry is about, in a word or two."""
    return LABELS.get(record.kind, record.type)


def headline(record: EntryRecord[Any]) -> str:
    """What the entry is, as something that Harvey did where it is an act."""
    if record.kind in (MotorCommand, Course):
        return f"Harvey was told to {sentence(record)}."
    if record.kind in (UserReport, Redirection):
        return f"It {sentence(record)}."
    if is_a(record, PictureRequest):
        return f"A picture was taken {words.purpose(record.value.purpose)}."
    if is_a(record, Hypothesis) and record.value.is_held:
        if record.value.basis == "relocalization":
            return f"It found out where it is: at {phrases.pose(record.value)}."
        return phrases.believed(record.value)
    return plainly(record) if sentence(record) else record.ref


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
            yield step("described", tell_source(self.world, record.value.locale), record)

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
            yield from self._match(record)
        if (kinds := FOLLOW.get(record.kind)) is not None:
            below = [one for kind in kinds for one in self._below(record, kind)]
        else:
            order = [ref.rpartition("-")[0] for ref in record.because]
            below = sorted(self._below(record), key=lambda one: order.index(one.ref.rpartition("-")[0]))
        for one in below:
            yield from self._tell(one, record)
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
                yield from self._one(key, LABELS[kind], SENTENCES[kind](self.history, found), found)

    def _below(self, record: EntryRecord[Any], kind: type[Any] | None = None) -> Iterator[EntryRecord[Any]]:
        """What an entry rests on beside itself, of a kind or of any."""
        for ref in record.because:
            if kind is None or ref.startswith(f"{kind.__name__}-"):
                found = self.history.entry(ref)
                if found is not None and found.id != record.id:
                    yield found

    def _tell(self, record: EntryRecord[Any], above: EntryRecord[Any]) -> Iterator[Step]:
        """An entry that something rests on, then what it rests on itself."""
        perhaps = is_a(record, Hypothesis) and record.value.status == "candidate"
        key = record.id if record.kind in SEVERAL or perhaps else record.type
        if key in self.told or record.ref in self.met or len(self.told) > MOST or len(self.met) > MOST_MET:
            return
        self.met.add(record.ref)
        label, say, frame = label_of(record), SENTENCES.get(record.kind), None
        if perhaps:
            label, text = "thought", f"It may have stood at {phrases.pose(record.value)} ({record.value.weight:.0%})."
        elif is_a(record, Segments) and above.kind in (MotorCommand, PictureRequest):
            frame = self.history.reason(record, CameraPicture)
            text = f"It saw {phrases.describe_segments(record.value)}; where it is did not yet follow from them."
        else:
            text = "" if record.kind in FOLDED else say(self.history, record) if say else plainly(record)
        yield from self._one(key, label, text, record, frame)
        if perhaps:
            for below in self._below(record, PlaceSearch):
                yield from self._tell(below, record)
        else:
            yield from self.reasons(record)

    def _one(self, key: str, label: str, text: str, *records: EntryRecord[Any] | None) -> Iterator[Step]:
        if text and key not in self.told:
            self.told.add(key)
            yield step(label, text, *records)

    def _belief(self, record: EntryRecord[Hypothesis]) -> Iterator[Step]:
        """What it saw, what it had expected; what it was sure of last."""
        history, before, expected = self.history, self.history.reason(record, Hypothesis), record
        if record.value.basis == "tracks":
            if (tracks := history.tracks_of(record)) is not None:
                moved = phrases.describe_belief_change(record.value, before.value) if before is not None else ""
                text = f"{phrases.tracking(tracks.value)} {moved}".strip()
                yield from self._one("Tracks", "seen", text, tracks, history.reason(record, CameraPicture))
            expected = before or record
        report = history.reason(expected, MotionReport) if expected.value.basis == "odometry" else None
        if report is not None:
            led_to = phrases.pose(expected.value)
            text = f"That was expected because {phrases.wheels(report.value)}, which led to {led_to}."
            yield from self._one("MotionReport", "expected", text, expected, report)
        yield from self._anchor(record)

    def _anchor(self, record: EntryRecord[Hypothesis]) -> Iterator[Step]:
        """What the belief began with: a milestone, finding itself anew, or what the user told."""
        anchor = self.history.anchor_of(record)
        if anchor is None:
            return
        begun, certificate = phrases.pose(anchor.value), self.history.reason(anchor, Certificate)
        if anchor.value.basis == "relocalization":
            _, _, segments, frame = self.history.chain(anchor, PlaceSearch, Panorama, Segments, CameraPicture)
            lost = self.history.reason(anchor, Discrepancy)
            found = f"; {anchor.value.evidence}" if anchor.value.evidence else ""
            picture = frame.id if frame is not None else "a picture"
            text = f"It found out anew where it was, in cycle {anchor.cycle}, from {picture}: at {begun}{found}."
            yield from self._one("recognized", "recognized", text, anchor, segments, frame)
            if lost is not None:
                yield from self._tell(lost, anchor)
        elif certificate is not None:
            yield from self._certificate(certificate, f"In cycle {certificate.cycle} ")
        elif (command := self.history.reason(anchor, Command)) is not None:
            text = f"Where it began it was told by the user: at {begun}."
            yield from self._one("told", "told", text, anchor, command)

    def _certificate(self, record: EntryRecord[Certificate], when: str = "") -> Iterator[Step]:
        fix, milestone = self.history.reason(record, PoseFix), self.history.reason(record, Milestone)
        said = capital(when + phrases.verdict(record.value, None if milestone is None else milestone.value))
        yield from self._one(record.id, "checked", said, record, milestone)
        if fix is not None:
            yield from self._match(fix)

    def _match(self, fix: EntryRecord[PoseFix]) -> Iterator[Step]:
        """From pixels and model to a pose."""
        match, segments = self.history.chain(fix, LineMatch, Segments)
        yield from self._one(fix.id, "matched", phrases.describe_line_match(self.history, fix), fix, match, segments)
        for text, refs in model.tell_model_lines(self.history, fix, self.world):
            if text not in self.told:
                self.told.add(text)
                yield Step("model", text, refs)


def _line(history: Timeline, record: EntryRecord[Leg]) -> str:
    sketch = history.nearest(record, PlanSketch)
    return phrases.line(record.value, sketch.value if sketch and sketch.id == record.value.sketch else None)


SENTENCES: Mapping[type[Any], Callable[[Timeline, EntryRecord[Any]], str]] = {
    Leg: _line,
    Hypothesis: lambda _, r: phrases.believed(r.value),
    Milestone: lambda _, r: phrases.expectation(r.value),
    Discrepancy: lambda _, r: phrases.doubt(r.value),
    PlanSketch: lambda _, r: phrases.plan(r.value),
    Goal: lambda _, r: phrases.goal(r.value),
    UserReport: lambda _, r: headline(r),
    Redirection: lambda _, r: headline(r),
    Command: lambda _, r: f"The user asked for it: {r.value.text}.",
}
LABELS: Mapping[type[Any], str] = {
    Leg: "driving", Hypothesis: "believed", Milestone: "looked for", Discrepancy: "doubted", PlanSketch: "plan",
    Goal: "goal", Command: "command", Tracks: "seen", CameraPicture: "picture", MotionReport: "wheels",
    MotorCommand: "motion", Course: "motion",
    PictureRequest: "look", Segments: "seen", PlaceSearch: "thought", BodyFault: "fault", Recovery: "recovery",
    Ride: "ride", RideReport: "ride", Obstruction: "hidden", Quiescence: "stillness", Outcome: "the end",
    Resumed: "resumed", Drift: "wheels", Travel: "wheels", LocaleFrame: "known", FrameRequest: "asked",
    CameraState: "camera",
    Wheels: "wheels", Footprint: "body", Contact: "touched", Ranges: "ranges", UserReport: "told",
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
    MotorCommand: (Leg, Milestone, PlaceSearch, Discrepancy, Hypothesis),
    PlaceSearch: (Panorama, Hypothesis),
    Panorama: (Obstruction, Panorama),
    Course: (Leg, Discrepancy, Hypothesis),
    Leg: (Hypothesis,),
    Milestone: (Obstruction, Certificate, Discrepancy, Hypothesis),
    Certificate: (Milestone,),
    PoseFix: (LineMatch,),
    LineMatch: (Segments, Milestone),
    Segments: (CameraPicture, Milestone),
    Tracks: (CameraPicture, Hypothesis),
    Hypothesis: (BodyFault,),
    Discrepancy: (Discrepancy, BodyFault, Contact, Certificate, Hypothesis, MotionReport),
    Goal: (Redirection, PlanSketch, Hypothesis),
    PlanSketch: (Milestone, Leg, PlanSketch, Hypothesis),
    PictureRequest: (Milestone, Discrepancy, Segments, Hypothesis),
    CameraPicture: (PictureRequest, Course),
    MotionReport: (MotorCommand, Course),
    Contact: (MotorCommand, Course),
    Ride: (PlanSketch, Hypothesis),
    RideReport: (Ride,),
    LocaleFrame: (UserReport, FrameRequest),
}
"""Which reasons a story follows, in which order; of a type that is not named here, all."""


def lines_of(told: Story) -> Iterator[str]:
    """A story as paragraphs: label, sentences and the entries that say so."""
    yield wrap(named(told.headline, [told.ref] * bool(told.ref)))
    if told.decided:
        yield wrap(told.decided)
    width = max((len(one.label) for one in told.steps), default=0)
    yield from (wrap(named(one.text, one.refs), f"  {one.label.ljust(width)}  ") for one in told.steps)
