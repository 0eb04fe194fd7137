"""The plan in the building: the goal, the way that the sketches foresee, the leg under way, the landmarks expected."""

from __future__ import annotations

import numpy as np
import rerun as rr

from logs.recording.board_mirror import Mirror, Moment
from logs.recording.logger import Logger, Subject
from logs.recording.palette import DONE, EXPECTED, PLANNED, faint
from logs.recording.paths import GOAL, LANDMARKS, LEG, PATH
from logs.recording.stream import RecordingStream
from world_models.entries.location import Place
from world_models.entries.task import Goal, Leg, Milestone, PlanSketch

Point = tuple[float, float, float]

FLAG_M = 3.0


class Plan(Logger):
    """Logs goal, sketches, leg and milestone when they change."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._world = subject.world
        self._last: dict[str, object] = {}

    def begin(self, stream: RecordingStream) -> None:
        stream.fix(GOAL, rr.Arrows3D.from_fields(radii=0.08, colors=[PLANNED], show_labels=True))
        stream.fix(LEG, rr.Arrows3D.from_fields(radii=0.06, colors=[PLANNED]))
        stream.fix(LANDMARKS, rr.LineStrips3D.from_fields(radii=0.03, colors=[EXPECTED]))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        if moment.touched(Goal):
            self._flag(stream, moment.mirror)
        if moment.touched(PlanSketch):
            self._way(stream, moment.mirror)
        if moment.touched(Leg):
            self._leg(stream, moment.mirror)
        if moment.touched(Milestone):
            self._landmarks(stream, moment.mirror)

    def _is_new(self, path: str, what: object) -> bool:
        """Whether something else is drawn there now."""
        before, self._last[path] = self._last.get(path), what
        return before != what

    def _point(self, place: Place, height_m: float) -> Point:
        pose = place.in_world(self._world)
        return pose.x_m, pose.y_m, height_m

    def _flag(self, stream: RecordingStream, mirror: Mirror) -> None:
        goals = [e.value for e in mirror.all(Goal) if e.value.status != "abandoned"]
        tops = [self._point(goal.destination, FLAG_M) for goal in goals]
        stream.log(GOAL, rr.Arrows3D, origins=tops, vectors=[(0.0, 0.0, -FLAG_M)] * len(tops),
                 labels=["goal" if goal.is_active else f"goal ({goal.status})" for goal in goals])

    def _way(self, stream: RecordingStream, mirror: Mirror) -> None:
        """Each sketch in use as a strip; the first level thin, what lies behind grey."""
        sketches = [e.value for e in mirror.all(PlanSketch) if e.value.status != "superseded"]
        if not self._is_new(PATH, [(sketch.subgoals, sketch.at, sketch.status) for sketch in sketches]):
            return
        strips, colours, radii = [], [], []
        for sketch in sketches:
            thick = 0.05 if sketch.path else 0.02
            for number, subgoal in enumerate(sketch.subgoals):
                behind = sketch.status == "done" or number < sketch.at
                strips.append([self._point(p, 0.03 + thick) for p in (subgoal.origin, subgoal.destination)])
                colours.append(faint(DONE, 160) if behind else faint(PLANNED, 255 if sketch.path else 110))
                radii.append(thick)
        lines = np.array(strips, np.float32).reshape(-1, 2, 3)
        stream.log(PATH, rr.LineStrips3D, strips=lines, colors=colours, radii=radii)

    def _leg(self, stream: RecordingStream, mirror: Mirror) -> None:
        last = mirror.latest(Leg, lambda g: g.status == "moving")
        legs = [last.value] if last else []
        ends = [(g.x0_m, g.y0_m, g.x1_m - g.x0_m, g.y1_m - g.y0_m) for g in legs]
        if self._is_new(LEG, ends):
            stream.log(LEG, rr.Arrows3D, origins=[(x, y, 0.15) for x, y, _, _ in ends],
                     vectors=[(dx, dy, 0.0) for _, _, dx, dy in ends])

    def _landmarks(self, stream: RecordingStream, mirror: Mirror) -> None:
        last = mirror.latest(Milestone)
        lines = last.value.expected if last and last.value.is_open else ()
        if self._is_new(LANDMARKS, lines):
            stream.log(LANDMARKS, rr.LineStrips3D, strips=np.array(lines, np.float32).reshape(-1, 2, 3))


LOGGERS = (Plan,)
