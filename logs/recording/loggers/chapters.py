"""Chapters: the turning points of a run, one line each: a table of contents of the recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import rerun as rr

from logs.explain.turning_points import TurningPoint, TurningPointFinder
from logs.recording.board_mirror import Moment
from logs.recording.logger import Logger, Panel, Subject, log_view
from logs.recording.palette import BELIEVED, DONE, LEVELS, MATCHED, PLANNED, REJECTED, REVISED, TRUE, VERDICTS, Colour
from logs.recording.paths import CHAPTERS
from logs.recording.stream import RecordingStream
from world_models import words
from world_models.frames import Pose2

ASTRAY_M, BACK_M = 0.2, 0.1
"""The belief is called wrong when it is so far from the truth, and right again when it is so near."""

COLOURS: Mapping[str, Colour] = {
    **VERDICTS, "goal": PLANNED, "plan": PLANNED, "doubt": LEVELS["plan"], "lost": REJECTED, "found": BELIEVED,
    "resumed": DONE, "in truth": TRUE, "collision": REJECTED, "contact": BELIEVED, "told": REVISED,
}


class Chapters(Logger):
    """Logs a line when something turns."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._belief = subject.belief
        self._finder = TurningPointFinder()
        self._truth: Pose2 | None = None
        self._is_astray = False

    def panels(self) -> Sequence[Panel]:
        view = log_view(CHAPTERS, "The story so far: turning points", "loglevel", "body")
        return (Panel(view, "words", 2, 7),)

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        points = (*self._of_the_truth(moment), *self._finder.find(moment.decision))
        for point in points:
            stream.log(CHAPTERS, rr.TextLog, text=[point.text], level=[point.kind], color=[_colour(point)])

    def _of_the_truth(self, moment: Moment) -> Iterator[TurningPoint]:
        """What the robot cannot know: that it touched something, that its belief went wrong, or is right again."""
        cycle = moment.decision.cycle
        for place in moment.contacts:
            yield TurningPoint(cycle, "collision", f"{place.words()}, as only the simulator knows")
        for pose in moment.truth[-1:]:
            self._truth = pose
        held = self._belief.now(moment.mirror) if self._truth is not None and moment.changes else None
        if held is None or self._truth is None:
            return
        off_m = self._truth.distance_to(held.world_from_robot)
        if off_m > (BACK_M if self._is_astray else ASTRAY_M):
            if not self._is_astray:
                yield TurningPoint(cycle, "in truth", f"{words.metres(off_m)} from where it believes to be")
            self._is_astray = True
        elif self._is_astray:
            self._is_astray = False
            yield TurningPoint(cycle, "in truth", f"right again, to {words.metres(off_m)}")


def _colour(point: TurningPoint) -> Colour:
    if point.kind == "fault":
        return DONE if point.text.endswith(", over") else REJECTED
    if point.kind == "the end":
        return MATCHED if point.text.startswith("reached") else REJECTED
    return COLOURS.get(point.kind, DONE)


LOGGERS = (Chapters,)
