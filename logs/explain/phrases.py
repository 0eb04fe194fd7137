"""The phrase book: what a sentence is, and what an entry, a decision, and an entry with its neighbours say.

Each entry has the sentence of its own kind. A run of another version, whose values do not fit their kinds, raises
BadInput.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from textwrap import fill
from typing import Any

from blackboard import Level
from logs.records import WHAT_IF, Candidate, EntryRecord, is_a
from logs.run_errors import BadInput
from logs.timeline import Timeline
from world_models import words
from world_models.building.locale_frame import FrameRequest
from world_models.entries import (
    Certificate,
    Command,
    Course,
    Discrepancy,
    Goal,
    Hypothesis,
    Leg,
    LineMatch,
    Milestone,
    MotionReport,
    MotorCommand,
    PictureRequest,
    Place,
    PlaceSearch,
    PlanSketch,
    PoseFix,
    Redirection,
    Segments,
    Track,
    Tracks,
    UserReport,
)
from world_models.words import count, degrees, landmark, listed, metres, point, quantity, size, turn

MAX_LISTED = 4
WIDTH = 120
"""Of a line of text [characters]."""
SLIGHT_RAD = math.radians(0.05)
CORRECTED_BY: Mapping[Level, str] = {
    Level.ACTION: "on the move", Level.PLAN: "at a milestone", Level.GOAL: "by finding out again where it is",
}
Find = Callable[[type[Any]], Any]
"""Gives the value of the first entry of a kind that something rests on; None where there is none."""


@dataclass(frozen=True, slots=True)
class Sentence:
    """Something that is said of a run.

    Attributes:
        text: one sentence or two.
        refs: the entries that say so; none for what only the simulator knows.
        cycle: when it was so; None for what is so during the whole run.
        label: what it is about, in a word or two.
        time_s: of the cycle, since the run began, by the body's clock; None where it is unknown.
    """

    text: str
    refs: tuple[str, ...] = ()
    cycle: int | None = None
    label: str = ""
    time_s: float | None = None


@dataclass(frozen=True, slots=True)
class Story:
    """Sentences under a headline: why an entry came about, or a part of what happened in a run.

    Attributes:
        headline: what the entry is, of a motion the whole chain in one sentence; or the part's title.
        steps: the reasons, from the entry downward; or what happened.
        ref: the entry; "" where it is about none.
        decided: who decided it, when, against what.
    """

    headline: str
    steps: tuple[Sentence, ...] = ()
    ref: str = ""
    decided: str = ""


def said(text: str, *records: EntryRecord[Any] | None, label: str = "") -> Sentence:
    """A sentence that some entries say, in the cycle of the first."""
    known = [record for record in records if record is not None]
    refs = dict.fromkeys(record.ref for record in known)
    return Sentence(text, tuple(refs), known[0].cycle if known else None, label)


def capital(text: str) -> str:
    """A clause as a sentence begins."""
    return text[:1].upper() + text[1:]


def wrap(text: str, first: str = "", rest: str | None = None) -> str:
    """A paragraph; ``first`` precedes it, and ``rest`` its other lines: as many blanks where None."""
    rest = " " * len(first) if rest is None else rest
    return fill(text, WIDTH, initial_indent=first, subsequent_indent=rest, break_on_hyphens=False)


def named(text: str, refs: Iterable[str]) -> str:
    """A text, and behind it in brackets the entries that say so."""
    inside = ", ".join(refs)
    return f"{text}  [{inside}]" if inside else text


def sentence(record: EntryRecord[Any]) -> str:
    """One sentence, without the entry's name and without a full stop."""
    try:
        text = words.sentence(record.value)
    except (BadInput, ValueError, TypeError, OverflowError):  # a kind, or fields, that this version does not know
        text = words.fields(record.fields)
    return f"{text}; no longer believed" if record.is_gone else text


def plainly(record: EntryRecord[Any]) -> str:
    """An entry's own sentence as a whole one."""
    return f"{capital(sentence(record))}."


def moment(history: Timeline, cycle: int) -> str:
    """``cycle 88, 12.3 s into the run``, as far as the time is known."""
    time_s = history.time_at(cycle)
    return f"cycle {cycle}" + ("" if time_s is None else f", {time_s:.1f} s into the run")


def describe_decision(history: Timeline, record: EntryRecord[Any]) -> str:
    """By whom, when and against what."""
    when = moment(history, record.cycle)
    if record.author == WHAT_IF:
        return f"It was revised in {when} by the question what if."
    if record.observed:
        return f"It came from outside, from {record.author}, and was taken up in {when}."
    decision = history.decision(record.cycle)
    text = f"Decided in {when}{',' * (',' in when)} by the {words.source(record.author)}"
    if decision.chosen is None:
        return text + "."
    c = decision.runner_up
    second = f"; next best was the {words.source(c.source)}, rated {c.rating:.2f}" if c else "; nobody else could act"
    return (f"{text}, woken by {decision.chosen.trigger}, rated {decision.chosen.rating:.2f}{second}."
            f"{_tell_questions(history, record, decision.chosen)}")


def _tell_questions(history: Timeline, record: EntryRecord[Any], chosen: Candidate) -> str:
    """What the act that made an entry had asked for before it came again; "" where it lacked nothing."""
    asked = [] if chosen.since == record.cycle else [
        request for request in history.of_kind(FrameRequest)
        if not request.revision and chosen.since <= request.cycle < record.cycle
        and (before := history.decision(request.cycle).chosen) is not None and before.number == chosen.number]
    wanted = [f"{sentence(request).removeprefix('asks ')} ({request.ref})" for request in asked]
    return f" It had waited for an answer first: it asked for {listed(wanted, MAX_LISTED)}." if wanted else ""


def tell_answer(history: Timeline, request: EntryRecord[Any]) -> Iterator[Sentence]:
    """What became of the act that asked."""
    asked = history.entry(f"{request.id}.0") or request
    act = history.decision(asked.cycle).chosen
    for later in () if act is None else history.naming(act.trigger):
        if act is not None and later.cycle > asked.cycle and later.chosen and later.chosen.number == act.number:
            refs = tuple(record.ref for record in later.made)
            made = listed(refs, MAX_LISTED) or "nothing"
            yield Sentence(f"The act waited for the answer, and came again in cycle {later.cycle}: it made {made}.",
                           refs[:MAX_LISTED], label="answered")
            return


def place(p: Place) -> str:
    return f"{point(p.x_m, p.y_m)} of {p.locale}"


def pose(h: Hypothesis) -> str:
    """Where a hypothesis says that the robot stands, and how surely."""
    p = h.locale_from_robot
    sure = (f"within {metres(h.sigma_m)} and {degrees(h.sigma_rad)}, one sigma; protection level"
            f" {metres(h.protection_m)}")
    return f"{point(p.x_m, p.y_m)} of {h.locale}, heading {degrees(p.heading_rad)} ({sure})"


def believed(h: Hypothesis) -> str:
    return f"It believed that it stood at {pose(h)}."


def perhaps(hypotheses: Iterable[Hypothesis]) -> str:
    """The places that come into question, with their weights, the likeliest first; "" where there are none."""
    candidates = sorted((h for h in hypotheses if h.status == "candidate"), key=lambda h: -h.weight)
    return listed([f"{h.place()} ({h.weight:.0%})" for h in candidates], MAX_LISTED)


def line(leg: Leg, sketch: PlanSketch | None) -> str:
    """The line that is driven, and how the robot stood to it."""
    length_m = math.hypot(leg.x1_m - leg.x0_m, leg.y1_m - leg.y0_m)
    end = f" to {place(sketch.subgoals[leg.index].destination)}" if sketch is not None else ""
    text = f"It was driving a straight line of {metres(length_m)}{end}"
    if leg.to_go_m is None or leg.left_m is None:
        return text + f" ({leg.status} after {count(leg.increments, 'increment')})."
    text += f": {metres(abs(leg.to_go_m))} {'were left' if leg.to_go_m >= 0 else 'too far'}"
    side = "left" if leg.left_m >= 0 else "right"
    beside = f"{metres(abs(leg.left_m))} to the {side} of" if abs(leg.left_m) >= 0.0005 else "on"
    text += f", it stood {beside} the line"
    if leg.status == "moving" and leg.aim_rad is not None:
        return text + f", and the point of the line that it steers at lay {turn(leg.aim_rad)} of where it faced."
    return text + f", near enough within {metres(leg.tolerance_m)}."


def tracking(tracks: Tracks) -> str:
    """Which landmarks were found where, against where they were expected."""
    found, where = tracks.found_again(), tracks.frame
    old = [t for t in tracks.items if t.template_frame != where]
    if not found:
        return f"In {where} none of {count(len(old), 'landmark')} that it follows was found." if old else (
            f"It chose {count(len(tracks.items), 'landmark')} of {where} to follow.")
    middle = sorted(math.hypot(*track.shift_px) for track in found)[len(found) // 2]
    return (f"In {where} it found {len(found)} of the {count(len(old), 'landmark')} that it follows; a corner of"
            f" {_off(found[0])}, the furthest of them; half of them were within {middle:.1f} px.")


def _off(track: Track) -> str:
    """Where a landmark was, against its prediction."""
    (du, dv), (u, v) = track.shift_px, track.predicted_px
    parts = [f"{abs(du):.1f} px {'right' if du >= 0 else 'left'} of"] if abs(du) >= 0.05 else []
    parts += [f"{abs(dv):.1f} px {'below' if dv >= 0 else 'above'}"] if abs(dv) >= 0.05 else []
    return f"{landmark(track.landmark)} was {' and '.join(parts) or 'at'} its prediction at ({u:.0f}, {v:.0f}) px"


def describe_belief_change(now: Hypothesis, before: Hypothesis) -> str:
    """How far a new belief is from the one before; empty where they are in different frames."""
    if now.locale != before.locale:
        return ""
    a, b = before.locale_from_robot, now.locale_from_robot
    angle = math.remainder(b.heading_rad - a.heading_rad, math.tau)
    turned = f" and turned it {turn(angle)}" if abs(angle) >= SLIGHT_RAD else ""
    return f"That moved its belief by {metres(a.distance_to(b))}{turned}."


def wheels(report: MotionReport) -> str:
    """What the wheels claim."""
    parts = [f"turned {turn(report.turn_rad)}"] * (abs(report.turn_rad) > 1e-6)
    parts += [f"moved {metres(report.move_m)} ahead"] * (abs(report.move_m) > 1e-6)
    return f"the wheels claimed to have {' and '.join(parts) or 'stood still'}"


def describe_line_match(history: Timeline, record: EntryRecord[Any]) -> str:
    """Which segments of which frame were taken for which model elements, and what pose follows."""
    match, fix = history.reason(record, LineMatch), record.value
    if match is None:
        return f"The pose was solved from {fix.match}."
    seen, by_name = history.because(match, Segments), by_landmark(history, fix, match)
    where, agreeing = f" in {seen.frame if seen else 'a picture'}", int(fix.inliers.sum())
    if not by_name:
        return f"The pose was solved from {count(agreeing, 'pair')} of segment and model line{where}."
    (best, numbers), *others = by_name
    rest = [f"{landmark(name)} ({len(pairs)})" for name, pairs in others]
    more = f"; the other {agreeing - len(numbers)} with {listed(rest)}" if rest else ""
    of_all = f" of {count(len(seen.segments_px), 'line segment')}" if seen is not None else ""
    return (f"{agreeing}{of_all}{where} were paired with lines of the model: {_segments(numbers)} with"
            f" {landmark(best)}{more}.")


def by_landmark(history: Timeline, fix: PoseFix, match: EntryRecord[Any]) -> list[tuple[str, list[int]]]:
    """Landmarks with the segments that agree with the pose, those with most segments first."""
    milestone = history.because(match, Milestone)
    if milestone is None:
        return []
    pairs = match.value.pairs[fix.inliers].tolist()
    names = [milestone.landmarks[milestone.landmark_of[model]] for model, _ in pairs]
    return [(name, [segment for other, (_, segment) in zip(names, pairs, strict=True) if other == name])
            for name, _ in Counter(names).most_common()]


def _segments(numbers: list[int]) -> str:
    return f"{'segment' if len(numbers) == 1 else 'segments'} {listed(numbers)}"


def verdict(certificate: Certificate, milestone: Milestone | None) -> str:
    """What was concluded, with the numbers that decided."""
    what = milestone_name(milestone) if milestone is not None else certificate.milestone
    if certificate.verdict != "verified":
        return f"{what} was judged {certificate.verdict}: {certificate.reason}."
    off = f"{metres(certificate.deviation_m)} and {degrees(abs(certificate.deviation_rad))} from what was believed"
    return (f"{what} was verified: {certificate.reason}; the pose is {off}, and up to"
            f" {certificate.tolerance_px:.0f} px may be corrected.")


def milestone_name(milestone: Milestone) -> str:
    """``milestone M1 of the route``, or the check that it is."""
    name = milestone.name()
    return f"milestone {name}" if milestone.sketch else name if name.startswith("the ") else f"the {name}"


def milestone_of(record: EntryRecord[Any]) -> str:
    """As :meth:`~world_models.entries.task.Milestone.name`, without decoding its lines."""
    return str(record.fields["what"]).partition(", because")[0]


def expectation(milestone: Milestone) -> str:
    """What a milestone says should be seen."""
    name = milestone_name(milestone)
    if not milestone.expected:
        return f"It was to look for {name}, and first had to turn to where most is to be seen of it."
    names = [landmark(mark) for mark in milestone.landmarks]
    return f"At {name} it expected to see {count(len(milestone.expected), 'model line')} of {listed(names, 4)}."


def plan(sketch: PlanSketch) -> str:
    """Which sketch, how far along."""
    where, end = sketch.where(), place(sketch.subgoals[-1].destination)
    part = f"part {sketch.at + 1} of {len(sketch.subgoals)}"
    if sketch.status == "done":
        return f"Its plan {where} was carried out to its end, {end}."
    if sketch.status != "active":
        return f"Its plan {where} was {sketch.status} in {part}."
    if sketch.current is None:
        return f"This is in its plan {where}: at its end, {end}."
    return f"This is in its plan {where}: {part}, to {steps([sketch.current])}."


def steps(subgoals: Iterable[Any]) -> str:
    """Where some subgoals lead, one after the other."""
    return ", then ".join(place(s.destination) + (f" by {s.passage}" if s.passage else "") for s in subgoals)


def goal(value: Goal) -> str:
    said = {"reached": "The goal was reached", "visited": "The place was visited",
            "abandoned": "The goal was given up for a new one"}
    way = f"from {place(value.origin)} to {place(value.destination)}"
    return f"{said.get(value.status, 'All of it serves the goal')}: {way}."


def describe_segments(segments: Segments) -> str:
    """``179 line segments in CameraPicture-49 (contrast 41 of 255)``."""
    found = count(len(segments.segments_px), "line segment")
    return f"{found} in {segments.frame} (contrast {segments.contrast:.0f} of 255)"


def doubt(d: Discrepancy) -> str:
    """A discrepancy in words."""
    bound = f"; up to {quantity(d.bound, d.unit)} may be corrected there" if math.isfinite(d.bound) else ""
    large = "" if d.magnitude is None else f" ({size(d.magnitude, d.unit)}{bound})"
    came = {"escalated": ", so the next level had to deal with it", "corrected": ", and was corrected"}
    end = f"{d.what}{large}{came.get(d.status, '')}."
    return f"Something was not as expected, to be dealt with {CORRECTED_BY[d.level]}: {end}"


def motive(find: Find) -> Iterator[str]:
    """Why a motion was commanded, by what it rests on."""
    leg, milestone, search = find(Leg), find(Milestone), find(PlaceSearch)
    if leg is not None and leg.aim_rad is not None:
        yield f"because the line to follow lay {turn(leg.aim_rad)} of where it believed that it faced"
    elif milestone is not None:
        yield f"because it had to face {milestone_name(milestone)} to look for it"
    elif leg is None and search is not None:
        yield f"because it did not know where it was: {search.said}"


def in_one_sentence(history: Timeline, command: EntryRecord[Any]) -> str:
    """Why the robot moved as it did; "" for entries that are no motor command."""
    if command.kind not in (MotorCommand, Course):
        return ""
    belief = history.reason(command, Hypothesis)
    parts = [*motive(lambda kind: history.because(command, kind)),
             *(() if belief is None else (*_tell_worst_landmark(history, belief), *_tell_match(history, belief)))]
    return f"Harvey was told to {sentence(command)} {', '.join(parts)}." if parts else ""


def _tell_worst_landmark(history: Timeline, belief: EntryRecord[Any]) -> Iterator[str]:
    """The landmark that was furthest from its prediction, and the pose that the prediction was made from."""
    tracks, before = history.tracks_of(belief), history.reason(belief, Hypothesis)
    if belief.value.basis == "tracks" and tracks and before and (found := tracks.value.found_again()):
        yield f"because in {tracks.value.frame} {_off(found[0])} ({tracks.ref})"
        yield f"made from pose {before.ref}"


def _tell_match(history: Timeline, belief: EntryRecord[Any]) -> Iterator[str]:
    """The match that the belief goes back to, by the landmark of which most segments agree with it."""
    anchor = history.anchor_of(belief)
    fix, match = (None, None) if anchor is None else history.chain(anchor, PoseFix, LineMatch)
    if fix is not None and match is not None:
        seen, by_name = history.because(match, Segments), by_landmark(history, fix.value, match)
        where = f"in {seen.frame if seen else 'a picture'}"
        best = f"{_segments(by_name[0][1])} {where} against {landmark(by_name[0][0])}" if by_name else (
            f"{count(int(fix.value.inliers.sum()), 'pair')} {where}")
        yield f"{'' if belief.value.basis == 'tracks' else 'where its pose was '}made from match {match.id} of {best}"
    elif anchor is not None:
        yield f"made from pose {anchor.ref} by {anchor.value.basis}"


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
            return f"It found out where it is: at {pose(record.value)}."
        return believed(record.value)
    return plainly(record) if sentence(record) else record.ref


def phrase(history: Timeline, record: EntryRecord[Any]) -> str:
    """A whole sentence of an entry, as the phrase book has it for its kind; else the kind's own."""
    say = PHRASES.get(record.kind)
    return plainly(record) if say is None else say(history, record)


def tell(
    history: Timeline, record: EntryRecord[Any] | None, label: str, *others: EntryRecord[Any] | None
) -> list[Sentence]:
    """The phrase of an entry, which others say too; nothing where there is no such entry."""
    return [] if record is None else [said(phrase(history, record), record, *others, label=label)]


def _line_of_plan(history: Timeline, record: EntryRecord[Leg]) -> str:
    sketch = history.nearest(record, PlanSketch)
    return line(record.value, sketch.value if sketch and sketch.id == record.value.sketch else None)


PHRASES: Mapping[type[Any], Callable[[Timeline, EntryRecord[Any]], str]] = {
    Leg: _line_of_plan,
    Hypothesis: lambda _, r: believed(r.value),
    Milestone: lambda _, r: expectation(r.value),
    Discrepancy: lambda _, r: doubt(r.value),
    PlanSketch: lambda _, r: plan(r.value),
    Goal: lambda _, r: goal(r.value),
    UserReport: lambda _, r: headline(r),
    Redirection: lambda _, r: headline(r),
    Command: lambda _, r: f"The user asked for it: {r.value.text}.",
    PoseFix: lambda history, r: describe_line_match(history, r),
    Certificate: lambda history, r: capital(verdict(r.value, history.because(r, Milestone))),
}
