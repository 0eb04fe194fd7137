"""The story of an entry: the one chain from it down to pixels, model and goal that a person would tell.

Everything that an entry rests on is a graph; told whole it is long. A story follows the main reasons only, tells each
kind of thing once, at the place nearest to what is explained, and says by name from which entries each sentence comes.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from textwrap import fill

from blackboard.servoing import Discrepancy
from harvey.errors import BadInput
from harvey.run_files.records import EntryRecord
from harvey.why import facts
from harvey.why.decisions import describe_decision, tell_answer
from harvey.why.history import History
from harvey.why.links import STRANGE, anchor_of, nearest, reason, tracks_of, within
from harvey.why.model import frames
from harvey.why.model.world_file import WorldFile, tell_source
from harvey.why.sentences import sentence, value_of
from world_models import words as vocabulary
from world_models.entries.body import Look, MotionReport
from world_models.entries.location import Hypothesis
from world_models.entries.percepts import Segments, Tracks
from world_models.entries.task import Certificate, Command, Goal, Leg, Milestone, PlanSketch

MOST = 24
"""So many things are told at the most."""
MOST_PLAIN, MOST_MET = 12, 200
WIDTH = 120


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


def tell_stories(history: History, refs: Iterable[str], world: WorldFile | None = None) -> Iterator[Story]:
    """The story of each of some entries. Raises BadInput where the journal does not say how one came about."""
    for ref in refs:
        record = history.entry(ref)
        if record is None:
            history.verify()
            raise BadInput(f"{history.source}: expected {ref} in the journal, which does not say how it came about")
        yield story(history, record, world)


def story(history: History, record: EntryRecord, world: WorldFile | None = None) -> Story:
    """The story of one entry; where values have other fields than those known here, told by the entries as they are.

    Args:
        world: tells from which file and line model lines come; None where that is not asked for.
    """
    teller = _Teller(history, world)
    try:
        steps = [*teller.own(record), *teller.reasons(record), *teller.used(record), *teller.context(record)]
        head = facts.in_one_sentence(history, record) or headline(record)
    except STRANGE:
        steps, head = list(_plain_steps(history, record)), _plainly(history, record)
    return Story(record.ref, head, describe_decision(history, record), tuple(steps))


def _plain_steps(history: History, record: EntryRecord) -> Iterator[Step]:
    """The entries nearest below, each in its own sentence."""
    for below in itertools.islice(within(history, record), 1, MOST_PLAIN):
        yield Step(LABELS.get(below.type, below.type), _plainly(history, below), (below.ref,))


def headline(record: EntryRecord) -> str:
    """What the entry is, as something that Harvey did where it is an act."""
    said = sentence(record)
    if record.type in ("MotorCommand", "Course"):
        return f"Harvey was told to {said}."
    if record.type in ("Told", "Redirection"):
        return _describe_telling(record)
    if record.type == "Look":
        return f"A picture was taken {vocabulary.purpose(value_of(record, Look).purpose)}."
    if record.type == "Hypothesis" and value_of(record, Hypothesis).is_held:
        return _describe_belief(value_of(record, Hypothesis))
    return f"{said[0].upper()}{said[1:]}." if said else record.ref


def _describe_telling(record: EntryRecord) -> str:
    return f"It {sentence(record)}."


def _describe_belief(hypothesis: Hypothesis) -> str:
    if hypothesis.basis == "relocalization":
        return f"It found out where it is: at {facts.pose(hypothesis)}."
    return f"It believed that it stood at {facts.pose(hypothesis)}."


@dataclass(slots=True)
class _Teller:
    """Tells steps; ``told`` are the keys of those that were told already, ``met`` the entries that were come to."""

    history: History
    world: WorldFile | None = None
    told: set[str] = field(default_factory=set)
    met: set[str] = field(default_factory=set)

    def own(self, record: EntryRecord) -> Iterator[Step]:
        """What is said of an entry itself, beside its headline."""
        if record.type == "FrameRequest":
            yield from (Step("answered", *told) for told in tell_answer(self.history, record))
        elif record.type == "LocaleFrame" and self.world is not None:
            yield Step("described", tell_source(self.world, frames.reference_of(record).locale), (record.ref,))

    def used(self, record: EntryRecord) -> Iterator[Step]:
        """By what the act went that made an entry."""
        yield from (Step("known", *told) for told in frames.tell_used(self.history, record))

    def reasons(self, record: EntryRecord) -> Iterator[Step]:
        """What an entry rests on, below the entry itself."""
        if record.type == "Hypothesis":
            yield from self._belief(record)
        elif record.type == "Certificate":
            yield from self._certificate(record)
        elif record.type == "PoseFix":
            yield from self._tell_match(record)
        for type in FOLLOW.get(record.type) or [r.rpartition("-")[0] for r in record.because]:
            for below in self._below(record, type):
                yield from self._tell(below, record)
        for text, frame in frames.tell_changes(self.history, record):
            if frame.ref not in self.met:
                self.met.add(frame.ref)
                yield from self._one(text, "changed", text, frame)
                yield from self.reasons(frame)

    def context(self, record: EntryRecord) -> Iterator[Step]:
        """The plan, the goal and the command that all of it serves."""
        for type in ("PlanSketch", "Goal", "Command"):
            found = nearest(self.history, record, (type,))
            key = found.id if found is not None and type in SEVERAL else type
            if found is not None and found.id != record.id:
                yield from self._one(key, LABELS[type], SAY[type](self.history, found), found)

    def _below(self, record: EntryRecord, type: str) -> Iterator[EntryRecord]:
        for ref in record.because:
            found = self.history.entry(ref) if ref.rpartition("-")[0] == type else None
            if found is not None and found.id != record.id:
                yield found

    def _tell(self, record: EntryRecord, above: EntryRecord) -> Iterator[Step]:
        """An entry that something rests on, then what it rests on itself."""
        perhaps = record.type == "Hypothesis" and value_of(record, Hypothesis).status == "candidate"
        key = record.id if record.type in SEVERAL or perhaps else record.type
        if key in self.told or record.ref in self.met or len(self.told) > MOST or len(self.met) > MOST_MET:
            return
        self.met.add(record.ref)
        if record.type == "Segments" and above.type in ("MotorCommand", "Look"):
            frame = reason(self.history, record, "Frame")
            seen = facts.describe_segments(value_of(record, Segments), frame)
            text = f"It saw {seen}; where it is did not yet follow from them."
            yield from self._one(key, "seen", text, record, frame)
        elif perhaps:
            candidate = value_of(record, Hypothesis)
            text = f"It may have stood at {facts.pose(candidate)} ({candidate.weight:.0%})."
            yield from self._one(key, "thought", text, record)
            for below in self._below(record, "Panorama"):
                yield from self._tell(below, record)
            return
        elif record.type == "Hypothesis":
            text = f"It believed that it stood at {facts.pose(value_of(record, Hypothesis))}."
            yield from self._one(key, "believed", text, record)
        elif record.type not in FOLDED:
            say = SAY.get(record.type, _plainly)
            yield from self._one(key, LABELS.get(record.type, record.type), say(self.history, record), record)
        yield from self.reasons(record)

    def _one(self, key: str, label: str, text: str, *records: EntryRecord | None) -> Iterator[Step]:
        if text and key not in self.told:
            self.told.add(key)
            yield Step(label, text, tuple(dict.fromkeys(r.ref for r in records if r is not None)))

    def _belief(self, record: EntryRecord) -> Iterator[Step]:
        """What it saw, what it had expected; what it was sure of last."""
        basis = value_of(record, Hypothesis).basis
        if basis == "tracks":
            yield from self._tell_tracks(record)
        elif basis == "odometry":
            yield from self._tell_odometry(record)
        yield from self._tell_anchor(record)

    def _tell_tracks(self, record: EntryRecord) -> Iterator[Step]:
        history = self.history
        before, frame = reason(history, record, "Hypothesis"), reason(history, record, "Frame")
        tracks = tracks_of(history, record)
        if tracks is not None:
            now = value_of(record, Hypothesis)
            moved = facts.describe_belief_change(now, value_of(before, Hypothesis)) if before is not None else ""
            text = f"{facts.tracking(value_of(tracks, Tracks), frame)} {moved}".strip()
            yield from self._one("Tracks", "seen", text, tracks, frame)
        if before is not None and value_of(before, Hypothesis).basis == "odometry":
            yield from self._tell_odometry(before)

    def _tell_odometry(self, record: EntryRecord) -> Iterator[Step]:
        report = reason(self.history, record, "MotionReport")
        if report is not None:
            led_to = facts.pose(value_of(record, Hypothesis))
            text = f"That was expected because {facts.wheels(value_of(report, MotionReport))}, which led to {led_to}."
            yield from self._one("MotionReport", "expected", text, record, report)

    def _tell_anchor(self, record: EntryRecord) -> Iterator[Step]:
        """What the belief began with: a milestone, finding itself anew, or what the user told."""
        anchor = anchor_of(self.history, record)
        if anchor is None:
            return
        command, certificate = (reason(self.history, anchor, type) for type in ("Command", "Certificate"))
        begun = value_of(anchor, Hypothesis)
        if begun.basis == "relocalization":
            yield from self._tell_recognition(anchor)
        elif certificate is not None:
            yield from self._certificate(certificate, f"In cycle {certificate.cycle} ")
        elif command is not None:
            text = f"Where it began it was told by the user: at {facts.pose(begun)}."
            yield from self._one("told", "told", text, anchor, command)

    def _tell_recognition(self, anchor: EntryRecord) -> Iterator[Step]:
        """It was lost, and found where it was."""
        segments, lost = reason(self.history, anchor, "Segments"), reason(self.history, anchor, "Discrepancy")
        frame = None if segments is None else reason(self.history, segments, "Frame")
        begun = value_of(anchor, Hypothesis)
        found = f"; {begun.evidence}" if begun.evidence else ""
        text = (f"It found out anew where it was, in cycle {anchor.cycle}, from {facts.picture(frame)}: at"
                f" {facts.pose(begun)}{found}.")
        yield from self._one("recognized", "recognized", text, anchor, segments, frame)
        if lost is not None:
            yield from self._tell(lost, anchor)

    def _certificate(self, record: EntryRecord, when: str = "") -> Iterator[Step]:
        history = self.history
        fix, milestone = reason(history, record, "PoseFix"), reason(history, record, "Milestone")
        judged = None if milestone is None else value_of(milestone, Milestone)
        said = when + facts.verdict(value_of(record, Certificate), judged)
        yield from self._one(record.id, "checked", said[0].upper() + said[1:], record, milestone)
        if fix is not None:
            yield from self._tell_match(fix)

    def _tell_match(self, fix: EntryRecord) -> Iterator[Step]:
        """From pixels and model to a pose."""
        match = reason(self.history, fix, "LineMatch")
        segments = None if match is None else reason(self.history, match, "Segments")
        yield from self._one(fix.id, "matched", facts.describe_line_match(self.history, fix), fix, match, segments)
        for text, refs in frames.tell_model_lines(self.history, fix, self.world):
            if text not in self.told:
                self.told.add(text)
                yield Step("model", text, refs)


def _plainly(_history: History, record: EntryRecord) -> str:
    said = sentence(record)
    return f"{said[0].upper()}{said[1:]}."


def _line(history: History, record: EntryRecord) -> str:
    sketch = nearest(history, record, ("PlanSketch",))
    leg = value_of(record, Leg)
    return facts.line(leg, value_of(sketch, PlanSketch) if sketch is not None and sketch.id == leg.sketch else None)


SAY: Mapping[str, Callable[[History, EntryRecord], str]] = {
    "Leg": _line,
    "Milestone": lambda _, r: facts.expectation(value_of(r, Milestone)),
    "Discrepancy": lambda _, r: facts.doubt(value_of(r, Discrepancy)),
    "PlanSketch": lambda _, r: facts.plan(value_of(r, PlanSketch)),
    "Goal": lambda _, r: facts.goal(value_of(r, Goal)),
    "Told": lambda _, r: _describe_telling(r),
    "Redirection": lambda _, r: _describe_telling(r),
    "Command": lambda _, r: f"The user asked for it: {value_of(r, Command).text}.",
}
LABELS: Mapping[str, str] = {
    "Leg": "driving", "Milestone": "looked for", "Discrepancy": "doubted", "PlanSketch": "plan", "Goal": "goal",
    "Command": "command", "Tracks": "seen", "Frame": "picture", "MotionReport": "wheels", "MotorCommand": "motion",
    "Course": "motion",
    "Look": "look", "Segments": "seen", "Panorama": "thought", "BodyFault": "fault", "Recovery": "recovery",
    "Ride": "ride", "RideReport": "ride", "Obstruction": "hidden", "Quiescence": "stillness", "Outcome": "the end",
    "Resumed": "resumed", "Drift": "wheels", "Travel": "wheels", "LocaleFrame": "known", "FrameRequest": "asked",
    "CameraState": "camera",
    "Wheels": "wheels", "Footprint": "body", "Contact": "touched", "Ranges": "ranges", "Told": "told",
    "Redirection": "told",
    "FreeFloor": "floor", "FloorView": "floor", "FloorAppearance": "floor", "Obstacle": "in the way",
    "DoorState": "door",
}
FOLDED = frozenset({"PoseFix", "LineMatch", "Segments", "Certificate"})
"""Told by the sentences of what rests on them."""
SEVERAL = frozenset({"Discrepancy", "Goal", "PlanSketch", "BodyFault"})
"""Of these a story may tell more than one."""
FOLLOW: Mapping[str, tuple[str, ...]] = {
    "MotorCommand": ("Leg", "Milestone", "Segments", "Panorama", "Discrepancy", "Hypothesis"),
    "Panorama": ("Obstruction", "Panorama"),
    "Course": ("Leg", "Discrepancy", "Hypothesis"),
    "Leg": ("Hypothesis",),
    "Milestone": ("Obstruction", "Certificate", "Discrepancy", "Hypothesis"),
    "Certificate": ("Milestone",),
    "PoseFix": ("LineMatch",),
    "LineMatch": ("Segments", "Milestone"),
    "Segments": ("Frame", "Milestone"),
    "Tracks": ("Frame", "Hypothesis"),
    "Hypothesis": ("BodyFault",),
    "Discrepancy": ("Discrepancy", "BodyFault", "Contact", "Certificate", "Hypothesis", "MotionReport"),
    "Goal": ("Redirection", "PlanSketch", "Hypothesis"),
    "PlanSketch": ("Milestone", "Leg", "PlanSketch", "Hypothesis"),
    "Look": ("Milestone", "Discrepancy", "Segments", "Hypothesis"),
    "Frame": ("Look", "Course"),
    "MotionReport": ("MotorCommand", "Course"),
    "Contact": ("MotorCommand", "Course"),
    "Ride": ("PlanSketch", "Hypothesis"),
    "RideReport": ("Ride",),
    "LocaleFrame": ("Told", "FrameRequest"),
}
"""Which reasons a story follows, in which order; of a type that is not named here, all."""


def lines_of(told: Story) -> Iterator[str]:
    """A story as paragraphs: label, sentences and the entries that say so."""
    yield _wrap(f"{told.headline}  [{told.ref}]" if told.ref else told.headline)
    if told.decided:
        yield _wrap(told.decided)
    width = max((len(step.label) for step in told.steps), default=0)
    for step in told.steps:
        named = f"  [{', '.join(step.refs)}]" if step.refs else ""
        yield _wrap(step.text + named, f"  {step.label.ljust(width)}  ")


def _wrap(text: str, head: str = "") -> str:
    return fill(text, WIDTH, initial_indent=head, subsequent_indent=" " * len(head), break_on_hyphens=False)
