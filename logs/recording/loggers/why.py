"""Why: what Harvey wants, believes, does, expects, sees and doubts, in plain sentences."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from blackboard.entry import Entry
from blackboard.servoing import Discrepancy
from logs.recording.board_mirror import Held, Mirror, Moment, find_belief, sigma_m
from logs.recording.logger import Logger, Panel, Subject
from logs.recording.loggers.sketch_tree import subgoal_label
from logs.recording.messages import ACTIVITY_KINDS, activity, is_doubt, leg_under_way
from logs.recording.paths import WHY
from logs.recording.stream import RecordingStream
from world_models import words
from world_models.entries.body import BodyFault, MotorCommand, Recovery
from world_models.entries.location import Hypothesis
from world_models.entries.percepts import LineMatch, Panorama, PoseFix, Segments, Tracks
from world_models.entries.task import Certificate, Goal, Leg, Milestone, Outcome, PlanSketch
from world_models.frames import Pose2

MOST_REASONS = 5
MAX_HYPOTHESES = 4

Tell = Callable[[Mirror], str]


class Why(Logger):
    """Logs the text when something in it changed; only what rests on a change is worded anew."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._belief = subject.belief
        self._truth: Pose2 | None = None
        self._told: dict[str, str] = {}
        self._last = ""

    def panels(self) -> Sequence[Panel]:
        return (Panel(rrb.TextDocumentView(origin=WHY, name="What Harvey thinks now"), "words", 1, 12),)

    def begin(self, stream: RecordingStream) -> None:
        stream.fix(WHY, rr.TextDocument.from_fields(media_type="text/markdown"))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        for pose in moment.truth[-1:]:
            self._truth = pose
        touched = [chapter for chapter in CHAPTERS if moment.touched(*chapter[2])]
        if not touched:
            return
        for title, tell, _ in touched:
            self._told[title] = tell(moment.mirror)
        if moment.touched(Hypothesis):
            self._told[TRULY] = in_truth(self._belief.now(moment.mirror), self._truth)
        text = compose(self._told)
        if text != self._last:
            self._last = text
            stream.log(WHY, rr.TextDocument, text=[text])


def story(mirror: Mirror) -> str:
    """The text, as markdown: one short paragraph a theme, none where there is nothing to say."""
    return compose({title: tell(mirror) for title, tell, _ in CHAPTERS})


def compose(told: dict[str, str]) -> str:
    """Paragraphs in the order of the themes, the headline first."""
    titles = [title for title, _, _ in CHAPTERS]
    titles.insert(titles.index(BELIEVES) + 1, TRULY)
    parts = [f"**{title}** {told[title]}" for title in titles if title and told.get(title)]
    return "\n\n".join([f"### {told['']}", *parts] if told.get("") else parts)


def in_truth(held: Held | None, truth: Pose2 | None) -> str:
    """How wrong the belief is, which only a simulator can tell; "" where nobody can."""
    if held is None or truth is None:
        return ""
    off = truth.inverse() @ held.world_from_robot
    distance = words.metres(math.hypot(off.x_m, off.y_m))
    return f"that is {distance} and {words.degrees(abs(off.heading_rad))} off, which it cannot know."


def _headline(mirror: Mirror) -> str:
    return mirror.ask(activity).line


def _describe_outcome(mirror: Mirror) -> str:
    outcome = mirror.latest(Outcome)
    return f"{outcome.value.kind}: {outcome.value.reason}." if outcome else ""


def _ails(mirror: Mirror) -> str:
    """What is wrong with the body, and what is done about it."""
    fault = mirror.latest(BodyFault, lambda f: f.is_open)
    if fault is None:
        return ""
    trying = mirror.latest(Recovery, lambda r: r.fault == fault.id)
    tries = f"; {words.count(trying.value.tries, 'try', 'tries')} so far" if trying else ""
    return f"{fault.value.part}: {fault.value.what}. {fault.value.detail}{tries}."


def _wants(mirror: Mirror) -> str:
    goal = mirror.latest(Goal)
    if goal is None:
        return ""
    return f"to be in {goal.value.destination.words()}{'' if goal.value.is_active else f' ({goal.value.status})'}."


def _believes(mirror: Mirror) -> str:
    held = find_belief(mirror)
    if held is None:
        return "nothing about where it is: it is lost."
    pose = held.locale_from_robot
    sure = f"{1e3 * sigma_m(held):.0f} mm and {math.degrees(held.sigma_rad):.2f} degrees"
    return (f"it is in {held.locale} at {words.point(pose.x_m, pose.y_m)}, heading {words.degrees(pose.heading_rad)}, "
            f"give or take {sure} (from {held.basis}).")


def _may_be(mirror: Mirror) -> str:
    """The pose hypotheses while it is lost, the likeliest first."""
    hypotheses = [e.value for e in mirror.all(Hypothesis) if e.value.status == "candidate"]
    hypotheses.sort(key=lambda h: -h.weight)
    places = [f"{h.place()} ({h.weight:.0%})" for h in hypotheses]
    return words.listed(places, MAX_HYPOTHESES) + "." if places else ""


def _does(mirror: Mirror) -> str:
    leg = mirror.ask(leg_under_way)
    sketch = mirror.latest(PlanSketch, lambda s: s.is_active and s.current is not None)
    if leg is None or sketch is None:
        return "stands still" + (f"; next: {_next(sketch.value)}." if sketch else ".")
    way = math.hypot(leg.x1_m - leg.x0_m, leg.y1_m - leg.y0_m)
    doing = "has halted on" if _is_halted(mirror) else "drives"
    return (f"{doing} a straight leg of {words.metres(way)}, {_next(sketch.value)}; "
            f"{words.count(leg.increments, 'move')} so far.")


def _is_halted(mirror: Mirror) -> bool:
    """Nothing moves while something above the action level is in doubt."""
    return mirror.ask(activity).word in ("doubts", "is lost", "is in trouble")


def _next(sketch: PlanSketch) -> str:
    subgoal = sketch.current
    where = f" through {sketch.locale}" if sketch.locale else ""
    return f"part {sketch.at + 1} of {len(sketch.subgoals)}{where} ({subgoal_label(subgoal)})" if subgoal else "done"


def _expects(mirror: Mirror) -> str:
    last = mirror.latest(Milestone, lambda m: m.is_open)
    if last is None:
        return ""
    milestone = last.value
    if milestone.status == "turning":
        return f"to see {milestone.what}, once it has turned to {words.degrees(milestone.look_heading_rad)}."
    lines = words.count(len(milestone.expected), "line")
    return f"{milestone.what}: {lines} of {words.listed(milestone.landmarks)}."


def _sees(mirror: Mirror) -> str:
    return " ".join(part for part in (_describe_tracks(mirror), _describe_verification(mirror)) if part)


def _describe_tracks(mirror: Mirror) -> str:
    tracks = mirror.latest(Tracks)
    if tracks is None or not tracks.value.items:
        return ""
    items = tracks.value.items
    found = [track for track in items if track.found_px]
    return f"{len(found)} of the {len(items)} points that it follows."


def _describe_verification(mirror: Mirror) -> str:
    """The evidence for or against the milestone that is open, as far as it goes."""
    milestone, segments = mirror.latest(Milestone, lambda m: m.is_open), mirror.latest(Segments)
    if milestone is None or segments is None or segments.value.milestone != milestone.id:
        return ""
    parts = [f"{len(segments.value.segments_px)} line segments"]
    match = mirror.latest(LineMatch, lambda m: m.milestone == milestone.id)
    if match:
        parts.append(f"{len(match.value.pairs)} matched")
        fix = mirror.latest(PoseFix, lambda f: f.match == match.id)
        parts += [f"{int(fix.value.inliers.sum())} of these agree on one pose"] if fix else []
    return ", ".join(parts) + "."


def _concludes(mirror: Mirror) -> str:
    entry = mirror.latest(Certificate)
    if entry is None:
        return ""
    c = entry.value
    known = mirror.get(c.milestone)
    what = known.value.name() if known and isinstance(known.value, Milestone) else c.milestone
    off = f"{words.metres(c.deviation_m)} and {words.degrees(abs(c.deviation_rad))} from what it believed"
    return f"{what}: **{c.verdict}**. {c.reason}; {off}. A wrong place would look so with probability {c.p_false:.1g}."


def _doubts(mirror: Mirror) -> str:
    open_ones = [e.value for e in mirror.all(Discrepancy) if e.value.is_open and is_doubt(e.value)]
    return " ".join(map(_discrepancy, open_ones)) or "nothing at the moment."


def _discrepancy(d: Discrepancy) -> str:
    size = "not yet measured" if d.magnitude is None else words.size(d.magnitude, d.unit)
    bound = f", may correct up to {d.bound:.1f} {d.unit}" if math.isfinite(d.bound) else ""
    return f"{d.what}: {size} (at the {d.level} level{bound})."


def _because(mirror: Mirror) -> str:
    """The chain of reasons behind the last motor command."""
    command = mirror.latest(MotorCommand)
    if command is None:
        return ""
    what = words.motion(command.value.turn_rad, command.value.move_m)
    return ", ".join([what, *_chain(mirror, command)]) + "."


def _chain(mirror: Mirror, entry: Entry[Any]) -> list[str]:
    """What an entry rests on, what that rests on, and so on, each entry and each reason once."""
    parts: list[str] = []
    met = {entry.id}
    while len(parts) < MOST_REASONS:
        below = [known for ref in entry.because if (known := mirror.get(ref.id)) is not None and known.id not in met]
        if not below:
            break
        entry = min(below, key=_rank)
        met.add(entry.id)
        reason = _reason(entry)
        parts += [reason] if reason and reason not in parts else []
        if isinstance(entry.value, Discrepancy | Panorama):
            break
    return parts


def _rank(entry: Entry[Any]) -> int:
    """A smaller number for what says more to a person."""
    kinds = [type(entry.value) is kind for kind in SAYING]
    return kinds.index(True) if any(kinds) else len(SAYING)


def _reason(entry: Entry[Any]) -> str:
    value = entry.value
    if isinstance(value, Leg):
        return f"to follow {entry.id}"
    if isinstance(value, PlanSketch):
        return f"as {entry.id} has it for {value.locale or 'the route'}"
    if isinstance(value, Goal):
        return f"on the way to {value.destination.locale}"
    if isinstance(value, Discrepancy):
        return f"because {value.what}"
    if isinstance(value, Milestone):
        return f"to look for {value.name()}"
    return words.sentence(value) if isinstance(value, Panorama) else ""


SAYING = (Panorama, Milestone, Leg, PlanSketch, Goal, Discrepancy)
"""What says to a person why something was ordered, the nearest first; other entries are passed over."""

BELIEVES, TRULY = "It believes", "In truth"

CHAPTERS: tuple[tuple[str, Tell, tuple[type[Any], ...]], ...] = (
    ("", _headline, ACTIVITY_KINDS),
    ("The end:", _describe_outcome, (Outcome,)),
    ("Trouble:", _ails, (BodyFault, Recovery)),
    ("Harvey wants", _wants, (Goal,)),
    (BELIEVES, _believes, (Hypothesis,)),
    ("It may be at", _may_be, (Hypothesis,)),
    ("It does:", _does, (*ACTIVITY_KINDS,)),
    ("It expects", _expects, (Milestone,)),
    ("It sees", _sees, (Tracks, Milestone, Segments, LineMatch, PoseFix)),
    ("It doubts:", _doubts, (Discrepancy,)),
    ("It last judged", _concludes, (Certificate,)),
    ("Last order:", _because, (MotorCommand,)),
)
"""Title, what tells it, and the types of values that it rests on."""


LOGGERS = (Why,)
