"""Words: how to read the recording, what Harvey thinks now, and the turning points, its table of contents."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from blackboard import Entry, View, always
from logs.explain import phrases
from logs.explain.turning_points import SIMULATOR, Happening, TurningPoint, TurningPointFinder
from logs.recording.logger import Logger, Moment, Panel, Subject, log_view
from logs.recording.loggers.lanes import ACTIVITY_KINDS, activity, doubts, leg_under_way
from logs.recording.palette import BELIEVED, DONE, LEVELS, MATCHED, PLANNED, REJECTED, REVISED, TRUE, VERDICTS, Colour
from logs.recording.paths import CHAPTERS, DESCRIPTION, WHY
from logs.recording.stream import RecordingStream, viewable
from logs.timeline import find_belief
from world_models import words
from world_models.entries import (
    BodyFault,
    Certificate,
    Discrepancy,
    Goal,
    Hypothesis,
    LineMatch,
    Milestone,
    MotorCommand,
    Outcome,
    PlanSketch,
    PoseFix,
    Recovery,
    Segments,
    Tracks,
)
from world_models.frames import Pose2

Tell = Callable[[View], str]


class Why(Logger):
    """Logs the text when something in it changed; only what rests on a change is worded again."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._texts: dict[str, str] = {}

    def panels(self) -> Sequence[Panel]:
        return (Panel(rrb.TextDocumentView(origin=WHY, name="What Harvey thinks now"), "words", 1, 12),)

    def begin(self, stream: RecordingStream) -> None:
        stream.fix(WHY, rr.TextDocument.from_fields(media_type="text/markdown"))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        touched = [(title, tell) for title, (tell, *kinds) in THOUGHTS.items() if moment.touched(*kinds)]
        self._texts |= {title: tell(moment.mirror) for title, tell in touched}
        if moment.touched(Hypothesis):
            self._texts[TRULY] = in_truth(moment.off)
        if touched and self.is_new(WHY, text := compose(self._texts)):
            stream.log(WHY, rr.TextDocument, text=[text])


def compose(texts: Mapping[str, str]) -> str:
    """Paragraphs in the order of the themes; the beginning of each is its title."""
    parts = [f"**{title}** {text.removeprefix(title.lower()).lstrip()}" if title else f"### {text}"
             for title in THOUGHTS if (text := texts.get(title))]
    return "\n\n".join(parts)


def in_truth(off: Pose2 | None) -> str:
    """How wrong the belief is, which only a simulator can tell; "" where nobody can."""
    if off is None:
        return ""
    far = f"{words.metres(math.hypot(off.x_m, off.y_m))} and {words.degrees(abs(off.heading_rad))}"
    return f"that is {far} off, which it cannot know."


def _newest(kind: type[Any], where: Callable[[Any], bool] = always) -> Tell:
    """The sentence of the newest entry of a kind."""
    def tell(board: View) -> str:
        entry = board.latest(kind, where)
        return "" if entry is None else f"{words.sentence(entry.value)}."
    return tell


def _ails(board: View) -> str:
    """What is wrong with the body, and what is done about it."""
    fault = board.latest(BodyFault, lambda f: f.is_open)
    trying = None if fault is None else board.latest(Recovery, lambda r: r.fault == fault.id)
    return ". It ".join(words.sentence(entry.value) for entry in (fault, trying) if entry) + "." * (fault is not None)


def _believes(board: View) -> str:
    held = find_belief(board)
    if held is None:
        return "nothing about where it is: it is lost."
    return f"that it stands at {phrases.pose(held.value)}, by {held.value.basis}."


def _may_be(board: View) -> str:
    """The places that come into question while it is lost."""
    places = phrases.perhaps(entry.value for entry in board.all(Hypothesis))
    return f"{places}." if places else ""


def _does(board: View) -> str:
    leg = leg_under_way(board)
    is_halted = activity(board)[0] in ("doubts", "is lost", "is in trouble")
    return "stands still." if leg is None else f"{'has halted on' if is_halted else 'drives'} a {words.brief(leg)}."


def _sees(board: View) -> str:
    """Of what it follows, and of the milestone that is open, as far as the evidence goes."""
    milestone = board.latest(Milestone, lambda m: m.is_open)
    seen: list[Entry[Any] | None] = [board.latest(Tracks)]
    if milestone is not None:
        match = board.latest(LineMatch, lambda m: m.milestone == milestone.id)
        fix = None if match is None else board.latest(PoseFix, lambda f: f.match == match.id)
        seen += [board.latest(Segments, lambda s: s.milestone == milestone.id), match, fix]
    return "; ".join(words.brief(entry.value) for entry in seen if entry) + "." * any(seen)


def _judged(board: View) -> str:
    last = board.latest(Certificate)
    milestone = None if last is None else board.get(last.value.milestone)
    return "" if last is None else phrases.verdict(last.value, milestone and milestone.value)


def _order(board: View) -> str:
    """The last motor command, and why."""
    command = board.latest(MotorCommand)
    if command is None:
        return ""
    known = [entry.value for ref in command.because if (entry := board.get(ref.id)) is not None]
    why = phrases.motive(lambda kind: next((value for value in known if isinstance(value, kind)), None))
    return f"{', '.join([words.sentence(command.value), *why])}."


TRULY = "In truth"
THOUGHTS: Mapping[str, tuple[Any, ...]] = {
    "": (lambda board: activity(board)[1], *ACTIVITY_KINDS),
    "The mission ended:": (_newest(Outcome), Outcome),
    "Trouble:": (_ails, BodyFault, Recovery),
    "Goal:": (_newest(Goal), Goal),
    "It believes": (_believes, Hypothesis),
    TRULY: (lambda _: "",),
    "It may stand at": (_may_be, Hypothesis),
    "Plan sketch": (_newest(PlanSketch, lambda s: s.is_active and s.current is not None), PlanSketch),
    "It does:": (_does, *ACTIVITY_KINDS),
    "Milestone": (_newest(Milestone, lambda m: m.is_open), Milestone),
    "It sees": (_sees, Tracks, Milestone, Segments, LineMatch, PoseFix),
    "It doubts:": (lambda board: f"{'; '.join(map(words.brief, doubts(board))) or 'nothing now'}.", Discrepancy),
    "It last judged": (_judged, Certificate),
    "Last order:": (_order, MotorCommand),
}
"""Title -> what tells it, and the types of values that it rests on."""
ASTRAY_M, BACK_M = 0.2, 0.1
"""The belief is called wrong when it is so far from the truth, and right again when it is so near."""
COLOURS: Mapping[str, Colour] = {
    **VERDICTS, "goal": PLANNED, "plan": PLANNED, "doubt": LEVELS["plan"], "lost": REJECTED, "found": BELIEVED,
    "resumed": DONE, "in truth": TRUE, SIMULATOR: TRUE, "collision": REJECTED, "contact": BELIEVED, "told": REVISED,
}


class Chapters(Logger):
    """Logs a line when something turns."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._finder = TurningPointFinder()
        self._is_astray = False

    def panels(self) -> Sequence[Panel]:
        view = log_view(CHAPTERS, "The story so far: turning points", "loglevel", "body")
        return (Panel(view, "words", 2, 7),)

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        for point in (*self._of_the_truth(moment), *self._finder.find(moment.decision)):
            stream.log(CHAPTERS, rr.TextLog, text=[point.text], level=[point.kind], color=[_colour(point)])

    def _of_the_truth(self, moment: Moment) -> Iterator[TurningPoint]:
        """What the robot cannot know: what was done to it, what it touched, that its belief went wrong, or is right."""
        cycle = moment.decision.cycle
        yield from (Happening(cycle, what).turning_point() for what in moment.happened)
        for place in moment.contacts:
            yield TurningPoint(cycle, "collision", f"{place.words()}, as only the simulator knows")
        if moment.truth is None or moment.held is None or not moment.changes:
            return
        off_m = moment.truth.distance_to(moment.held.world_from_robot)
        was, self._is_astray = self._is_astray, off_m > (BACK_M if self._is_astray else ASTRAY_M)
        if self._is_astray and not was:
            yield TurningPoint(cycle, "in truth", f"{words.metres(off_m)} from where it believes to be")
        elif was and not self._is_astray:
            yield TurningPoint(cycle, "in truth", f"right again, to {words.metres(off_m)}")


def _colour(point: TurningPoint) -> Colour:
    if point.kind == "fault":
        return DONE if point.text.endswith(", over") else REJECTED
    if point.kind == "the end":
        return MATCHED if point.text.startswith("reached") else REJECTED
    return COLOURS.get(point.kind, DONE)


TEXT = """\
Harvey drives from room to room by what its camera shows. Knowledge sources round a blackboard decide,
**one decision a cycle**.
Play, or drag the cursor at the bottom; click the number of a turning point to go there.

**Levels:** *action* (blue) corrects moves, *plan* (orange) checks milestones, *goal* (red) finds a lost robot.
**Ring:** doubt, 1 sigma, 20 times as large; **bands** in plots: ±1 sigma. **Arrows in the picture:** drift, 5 times as
long. **Grey:** done. **Outlined rooms:** known on the board, pink ones otherwise than in the file. Ask on with
`harvey why`.
"""


class Description(Logger):
    """Logs once how to read the recording."""

    def panels(self) -> Sequence[Panel]:
        return (Panel(rrb.TextDocumentView(origin=DESCRIPTION, name="How to read this"), "words", 1, 11),)

    def begin(self, stream: RecordingStream) -> None:
        text = f"**{viewable(self.subject.title)}**. {TEXT}"
        stream.fix(DESCRIPTION, rr.TextDocument(text, media_type="text/markdown"))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        """It does not change."""


LOGGERS = (Why, Chapters, Description)
