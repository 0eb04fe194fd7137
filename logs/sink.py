"""Recorder: the scheduler's sink that keeps the diary, ``recording.rrd``."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from blackboard.journal import Decision, decision_line
from logs.blueprint import blueprint, describe
from logs.loggers import Logger
from logs.loggers.building import Building
from logs.loggers.decisions import Decisions
from logs.loggers.errors import Errors
from logs.loggers.frames import Frames
from logs.loggers.image import Image
from logs.loggers.lanes import Lanes
from logs.loggers.plan import Plan
from logs.loggers.robots import Robots
from logs.loggers.sketch_tree import SketchTree
from logs.loggers.why import Why
from logs.mirror import Mirror, Moment
from logs.paths import DESCRIPTION
from logs.tape import Tape
from world_models.body import Frame, MotionReport
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2
from world_models.world import World


class Recorder:
    """Draws every decision.

    It learns of the mission from the decisions alone, and of the true robot, where somebody knows it, from
    :meth:`truth`. On hardware nobody does.
    """

    def __init__(
        self, path: Path | None, *, world: World, camera: Camera, mount: CameraMount, title: str, recording_id: str,
        live: bool = False, line_of: Callable[[Decision], str] = decision_line,
    ) -> None:
        """Begin a recording in a file (``path``), for a viewer that connects now (``live``), or both.

        ``line_of`` gives a decision's line in the journal; :meth:`JournalFile.line` spares making it twice.

        Raises:
            RecordingError: the file cannot be written.
            ValueError: neither path nor live.
        """
        self._tape = Tape(path, recording_id, title, blueprint(world, camera), live=live)
        self._mirror = Mirror()
        self._sim_time_s = 0.0
        self._truth: list[Pose2] = []
        self._loggers: tuple[Logger, ...] = (
            Building(world), Robots(world, camera, mount), Plan(world), Frames(camera), Image(camera),
            SketchTree(), Lanes(), Decisions(line_of), Errors(world), Why(),
        )
        self._tape.fix(DESCRIPTION, describe(title))
        for logger in self._loggers:
            logger.begin(self._tape)

    def truth(self, world_from_robot: Pose2, sim_time_s: float) -> None:
        """Where the robot truly is; drawn with the next decision."""
        self._truth.append(world_from_robot)
        self._sim_time_s = max(self._sim_time_s, sim_time_s)

    def __call__(self, decision: Decision) -> None:
        """Draw one decision.

        Raises:
            RecordingError: the recording cannot be written any more.
        """
        moment = self._moment(decision)
        self._tape.at(decision.cycle, self._sim_time_s)
        for logger in self._loggers:
            logger.log(self._tape, moment)
        self._tape.end_cycle()

    def close(self) -> None:
        """End the recording.

        Raises:
            RecordingError: its last part could not be written.
        """
        self._tape.close()

    def _moment(self, decision: Decision) -> Moment:
        moment = Moment(decision, self._mirror, tuple(self._truth))
        self._truth.clear()
        for change in moment.changes:
            self._mirror.take(change)
        times = [*(e.value.sim_time_s for e in moment.changed(Frame)),
                 *(e.value.sim_time_s for e in moment.changed(MotionReport))]
        self._sim_time_s = max([self._sim_time_s, *times])
        return moment
