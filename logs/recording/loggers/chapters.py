"""Chapters: the turning points of a run, one line each: a table of contents of the recording."""

from __future__ import annotations

from collections.abc import Iterator

import rerun as rr

from blackboard.change import Change, Posted
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from logs.recording.belief import Belief
from logs.recording.board_mirror import Mirror, Moment
from logs.recording.palette import BELIEVED, DONE, LEVELS, MATCHED, PLANNED, REJECTED, TRUE, VERDICTS, Colour
from logs.recording.paths import CHAPTERS
from logs.recording.stream import RecordingStream
from world_models import words
from world_models.entries.body import BodyFault
from world_models.entries.location import Hypothesis
from world_models.entries.task import Certificate, Goal, Milestone, Outcome, PlanSketch, Resumed
from world_models.frames import Pose2

ASTRAY_M, BACK_M = 0.2, 0.1
"""The belief is called wrong when it is so far from the truth, and right again when it is so near."""

Line = tuple[str, str, Colour]
"""A word for what kind of turning point it is, the line, and its colour."""


class Chapters:
    """Logs a line when something turns."""

    def __init__(self, belief: Belief) -> None:
        self._belief = belief
        self._truth: Pose2 | None = None
        self._is_astray = False

    def begin(self, stream: RecordingStream) -> None:
        """Nothing holds at all times."""

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        lines = [line for change in moment.changes for line in _turn(change, moment.mirror)]
        for level, text, colour in (*self._astray(moment), *lines):
            stream.log(CHAPTERS, rr.TextLog, text=[text], level=[level], color=[colour])

    def _astray(self, moment: Moment) -> Iterator[Line]:
        """What Harvey cannot know: that its belief went wrong, or is right again."""
        for pose in moment.truth[-1:]:
            self._truth = pose
        held = self._belief.now(moment.mirror) if self._truth is not None and moment.changes else None
        if held is None or self._truth is None:
            return
        off_m = self._truth.distance_to(held.world_from_robot)
        if off_m > (BACK_M if self._is_astray else ASTRAY_M):
            if not self._is_astray:
                yield "in truth", f"it is {words.metres(off_m)} from where it believes to be", TRUE
            self._is_astray = True
        elif self._is_astray:
            self._is_astray = False
            yield "in truth", f"it is right again, to {words.metres(off_m)}", TRUE


def _turn(change: Change, mirror: Mirror) -> Iterator[Line]:
    """The turning point that a change is, if it is one."""
    value, is_new = change.entry.value, isinstance(change, Posted)
    if isinstance(value, Goal) and (is_new or not value.is_active):
        yield "goal", f"{value.destination.locale}{'' if is_new else ': ' + value.status}", PLANNED
    elif isinstance(value, PlanSketch) and is_new:
        where = f"through {value.locale}" if value.locale else "from room to room"
        yield "plan", f"{where}, {words.count(len(value.subgoals), 'part')}", PLANNED
    elif isinstance(value, Certificate):
        yield value.verdict, _verdict(value, mirror), VERDICTS.get(value.verdict, DONE)
    elif isinstance(value, Discrepancy) and value.status == "escalated":
        lost = value.level.above is Level.GOAL
        text = "nothing fits: it asks where it is" if lost else value.what
        yield "lost" if lost else "doubt", text, REJECTED if lost else LEVELS["plan"]
    elif isinstance(value, Hypothesis) and value.is_held and value.basis == "relocalization":
        yield "found", f"itself, in {value.locale}", BELIEVED
    else:
        yield from _from_outside(value)


def _from_outside(value: object) -> Iterator[Line]:
    """The body's faults, a run that was cut off, the end."""
    if isinstance(value, BodyFault):
        ending, colour = ("", REJECTED) if value.is_open else (", over", DONE)
        yield "fault", f"{value.part}: {value.what}{ending}", colour
    elif isinstance(value, Resumed):
        yield "resumed", f"after cycle {value.after_cycle}, where the run was cut off", DONE
    elif isinstance(value, Outcome):
        yield "the end", f"{value.kind}: {value.reason}", MATCHED if value.kind == "reached" else REJECTED


def _verdict(certificate: Certificate, mirror: Mirror) -> str:
    entry = mirror.get(certificate.milestone)
    what = entry.value.what if entry and isinstance(entry.value, Milestone) else certificate.milestone
    if certificate.verdict == "verified":
        return f"{what}: {words.metres(certificate.deviation_m)} off"
    return f"{certificate.reason} ({what})"
