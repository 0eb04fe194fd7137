"""The story of an entry: the one chain from it down to pixels, model and goal that a person would tell.

Everything that an entry rests on is a graph; all of it would be long. A story follows the main reasons only, tells each
kind of thing once, at the place nearest to what is explained, and says by name from which entries each sentence comes.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from blackboard import Quiescence
from logs.explain import model, phrases
from logs.explain.model import WorldFile, tell_source
from logs.explain.phrases import (
    Sentence,
    Story,
    capital,
    describe_decision,
    headline,
    named,
    phrase,
    plainly,
    said,
    tell_answer,
    wrap,
)
from logs.records import EntryRecord, is_a
from logs.run_errors import UNREADABLE, BadInput
from logs.timeline import Timeline
from world_models.building.locale_frame import FrameRequest, LocaleFrame
from world_models.entries import (
    BodyFault,
    CameraPicture,
    CameraState,
    Certificate,
    Command,
    Contact,
    Course,
    Discrepancy,
    DoorState,
    Drift,
    FloorView,
    Footprint,
    FreeFloor,
    Goal,
    Hypothesis,
    Leg,
    LineMatch,
    Milestone,
    MotionReport,
    MotorCommand,
    Obstacle,
    Obstruction,
    Outcome,
    Panorama,
    PictureRequest,
    PlaceSearch,
    PlanSketch,
    PoseFix,
    Ranges,
    Recovery,
    Redirection,
    Resumed,
    Ride,
    RideReport,
    Segments,
    Tracks,
    Travel,
    UserReport,
    Wheels,
)

MOST, MOST_PLAIN, MOST_MET = 24, 12, 200
"""Most entries that are named, of a run of another version, and most that are reached."""
LEGEND = """\
Ask on by a name in brackets, of a thing, door or room: harvey why RUN NAME. All that it rests on: --depth 5."""


def tell_stories(history: Timeline, refs: Iterable[str], world: WorldFile | None = None) -> Iterator[Story]:
    """The story of each of some entries. Raises BadInput where the journal does not say how one came about."""
    for ref in refs:
        record = history.entry(ref)
        if record is None:
            history.verify()
            raise BadInput(f"{history.source}: expected {ref} in the journal, which does not say how it came about")
        yield story(history, record, world)


def story(history: Timeline, record: EntryRecord[Any], world: WorldFile | None = None) -> Story:
    """The story of one entry; where values have other fields than those known here, the entries as they are.

    Args:
        world: tells from which file and line model lines come; None where that is not asked for.
    """
    teller = _Teller(history, world)
    try:
        own: Iterable[Sentence] = tell_answer(history, record) if record.kind is FrameRequest else ()
        if record.kind is LocaleFrame and world is not None:
            own = (said(tell_source(world, record.value.locale), record, label="described"),)
        steps = [*own, *teller.reasons(record), *model.tell_used(history, record), *teller.context(record)]
        head = phrases.in_one_sentence(history, record) or headline(record)
    except UNREADABLE:
        below = itertools.islice(history.within(record), 1, MOST_PLAIN)
        steps, head = [said(plainly(one), one, label=label_of(one)) for one in below], plainly(record)
    return Story(head, tuple(steps), record.ref, describe_decision(history, record))


def label_of(record: EntryRecord[Any]) -> str:
    """What an entry is about, in a word or two."""
    return LABELS.get(record.kind, OTHERS)[0] or record.type


class _Teller:
    """Tells steps; ``shown`` are the keys of those that were shown already, ``met`` the entries that were reached."""

    def __init__(self, history: Timeline, world: WorldFile | None) -> None:
        self.history, self.world = history, world
        self.shown, self.met = set[str](), set[str]()

    def reasons(self, record: EntryRecord[Any]) -> Iterator[Sentence]:
        """What an entry rests on, below the entry itself."""
        if record.kind is Hypothesis:
            yield from self._belief(record)
        elif record.kind is Certificate:
            yield from self._certificate(record)
        elif record.kind is PoseFix:
            yield from self._match(record)
        if (kinds := LABELS.get(record.kind, OTHERS)[1]) is not None:
            below = [one for kind in kinds for one in self._below(record, kind)]
        else:
            order = [ref.rpartition("-")[0] for ref in record.because]
            below = sorted(self._below(record), key=lambda one: order.index(one.ref.rpartition("-")[0]))
        for one in below:
            yield from self._tell(one, record)
        for change in model.tell_changes(self.history, record):
            frame = self.history.entry(change.refs[0])
            if frame is not None and frame.ref not in self.met:
                self.met.add(frame.ref)
                yield from self._one(change.text, change.label, change.text, frame)
                yield from self.reasons(frame)

    def context(self, record: EntryRecord[Any]) -> Iterator[Sentence]:
        """The plan, the goal and the command that all of it serves."""
        for kind in CONTEXT:
            found = self.history.nearest(record, kind)
            if found is not None and found.id != record.id:
                key = found.id if kind in SEVERAL else found.type
                yield from self._one(key, LABELS[kind][0], phrase(self.history, found), found)

    def _below(self, record: EntryRecord[Any], kind: type[Any] | None = None) -> Iterator[EntryRecord[Any]]:
        """What an entry rests on besides itself, of a kind or of any."""
        for ref in record.because:
            if kind is None or ref.startswith(f"{kind.__name__}-"):
                found = self.history.entry(ref)
                if found is not None and found.id != record.id:
                    yield found

    def _tell(self, record: EntryRecord[Any], above: EntryRecord[Any]) -> Iterator[Sentence]:
        """An entry that something rests on, then what it rests on itself."""
        perhaps = is_a(record, Hypothesis) and record.value.status == "candidate"
        key = record.id if record.kind in SEVERAL or perhaps else record.type
        if key in self.shown or record.ref in self.met or len(self.shown) > MOST or len(self.met) > MOST_MET:
            return
        self.met.add(record.ref)
        label, frame = label_of(record), None
        if perhaps:
            label, text = "thought", f"It may have stood at {phrases.pose(record.value)} ({record.value.weight:.0%})."
        elif is_a(record, Segments) and above.kind in (MotorCommand, PictureRequest):
            frame = self.history.reason(record, CameraPicture)
            text = f"It saw {phrases.describe_segments(record.value)}; where it is did not yet follow from them."
        else:
            text = "" if record.kind in FOLDED else phrase(self.history, record)
        yield from self._one(key, label, text, record, frame)
        if perhaps:
            for below in self._below(record, PlaceSearch):
                yield from self._tell(below, record)
        else:
            yield from self.reasons(record)

    def _one(self, key: str, label: str, text: str, *records: EntryRecord[Any] | None) -> Iterator[Sentence]:
        if text and key not in self.shown:
            self.shown.add(key)
            yield said(text, *records, label=label)

    def _belief(self, record: EntryRecord[Hypothesis]) -> Iterator[Sentence]:
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

    def _anchor(self, record: EntryRecord[Hypothesis]) -> Iterator[Sentence]:
        """What the belief began with: a milestone, finding itself again, or what the user told."""
        anchor = self.history.anchor_of(record)
        if anchor is None:
            return
        begun, certificate = phrases.pose(anchor.value), self.history.reason(anchor, Certificate)
        if anchor.value.basis == "relocalization":
            _, _, segments, frame = self.history.chain(anchor, PlaceSearch, Panorama, Segments, CameraPicture)
            lost = self.history.reason(anchor, Discrepancy)
            found = f"; {anchor.value.evidence}" if anchor.value.evidence else ""
            picture = frame.id if frame is not None else "a picture"
            text = f"It found out again where it was, in cycle {anchor.cycle}, from {picture}: at {begun}{found}."
            yield from self._one("recognized", "recognized", text, anchor, segments, frame)
            if lost is not None:
                yield from self._tell(lost, anchor)
        elif certificate is not None:
            yield from self._certificate(certificate, f"In cycle {certificate.cycle} ")
        elif (command := self.history.reason(anchor, Command)) is not None:
            text = f"Where it began it was told by the user: at {begun}."
            yield from self._one("told", "told", text, anchor, command)

    def _certificate(self, record: EntryRecord[Certificate], when: str = "") -> Iterator[Sentence]:
        fix, milestone = self.history.reason(record, PoseFix), self.history.reason(record, Milestone)
        text = capital(when + phrases.verdict(record.value, None if milestone is None else milestone.value))
        yield from self._one(record.id, "checked", text, record, milestone)
        if fix is not None:
            yield from self._match(fix)

    def _match(self, fix: EntryRecord[PoseFix]) -> Iterator[Sentence]:
        """From pixels and model to a pose."""
        match, segments = self.history.chain(fix, LineMatch, Segments)
        yield from self._one(fix.id, "matched", phrases.describe_line_match(self.history, fix), fix, match, segments)
        for one in model.tell_model_lines(self.history, fix, self.world):
            if one.text not in self.shown:
                self.shown.add(one.text)
                yield one


OTHERS: tuple[str, None] = ("", None)
LABELS: Mapping[type[Any], tuple[str, tuple[type[Any], ...] | None]] = {
    BodyFault: ("fault", None),
    CameraPicture: ("picture", (PictureRequest, Course)),
    CameraState: ("camera", None),
    Certificate: ("", (Milestone,)),
    Command: ("command", None),
    Contact: ("touched", (MotorCommand, Course)),
    Course: ("motion", (Leg, Discrepancy, Hypothesis)),
    Discrepancy: ("doubted", (Discrepancy, BodyFault, Contact, Certificate, Hypothesis, MotionReport)),
    DoorState: ("door", None),
    Drift: ("wheels", None),
    FloorView: ("floor", None),
    Footprint: ("body", None),
    FrameRequest: ("asked", None),
    FreeFloor: ("floor", None),
    Goal: ("goal", (Redirection, PlanSketch, Hypothesis)),
    Hypothesis: ("believed", (BodyFault,)),
    Leg: ("driving", (Hypothesis,)),
    LineMatch: ("", (Segments, Milestone)),
    LocaleFrame: ("known", (UserReport, FrameRequest)),
    Milestone: ("looked for", (Obstruction, Certificate, Discrepancy, Hypothesis)),
    MotionReport: ("wheels", (MotorCommand, Course)),
    MotorCommand: ("motion", (Leg, Milestone, PlaceSearch, Discrepancy, Hypothesis)),
    Obstacle: ("in the way", None),
    Obstruction: ("hidden", None),
    Outcome: ("the end", None),
    Panorama: ("", (Obstruction, Panorama)),
    PictureRequest: ("look", (Milestone, Discrepancy, Segments, Hypothesis)),
    PlaceSearch: ("thought", (Panorama, Hypothesis)),
    PlanSketch: ("plan", (Milestone, Leg, PlanSketch, Hypothesis)),
    PoseFix: ("", (LineMatch,)),
    Quiescence: ("stillness", None),
    Ranges: ("ranges", None),
    Recovery: ("recovery", None),
    Redirection: ("told", None),
    Resumed: ("resumed", None),
    Ride: ("ride", (PlanSketch, Hypothesis)),
    RideReport: ("ride", (Ride,)),
    Segments: ("seen", (CameraPicture, Milestone)),
    Tracks: ("seen", (CameraPicture, Hypothesis)),
    Travel: ("wheels", None),
    UserReport: ("told", None),
    Wheels: ("wheels", None),
}
"""What an entry of a kind is about, in a word or two, and which reasons of it a story follows, in which order; where
None stands, and of a kind that is not named here, all."""
CONTEXT: tuple[type[Any], ...] = (PlanSketch, Goal, Command)
"""What all of it serves."""
FOLDED = frozenset({PoseFix, LineMatch, Segments, Certificate})
"""The sentences of what rests on them name these."""
SEVERAL = frozenset({Discrepancy, Goal, PlanSketch, BodyFault})
"""Of these a story may tell more than one."""


def lines_of(shown: Story) -> Iterator[str]:
    """A story as paragraphs: label, sentences and the entries that say so."""
    yield wrap(named(shown.headline, [shown.ref] * bool(shown.ref)))
    if shown.decided:
        yield wrap(shown.decided)
    width = max((len(one.label) for one in shown.steps), default=0)
    yield from (wrap(named(one.text, one.refs), f"  {one.label.ljust(width)}  ") for one in shown.steps)
