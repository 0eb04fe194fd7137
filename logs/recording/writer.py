"""RecordingWriter: the scheduler's sink that keeps the recorder, ``recording.rrd``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from blackboard.journal import Decision, decision_line
from logs.recording.belief import Belief
from logs.recording.blueprint import blueprint, describe
from logs.recording.board_mirror import Mirror, Moment
from logs.recording.loggers import Logger
from logs.recording.loggers.building import Building
from logs.recording.loggers.chapters import Chapters
from logs.recording.loggers.decisions import Decisions
from logs.recording.loggers.errors import Errors
from logs.recording.loggers.frames import Frames
from logs.recording.loggers.image import Image
from logs.recording.loggers.lanes import Lanes
from logs.recording.loggers.plan import Plan
from logs.recording.loggers.robots import Robots
from logs.recording.loggers.sketch_tree import SketchTree
from logs.recording.loggers.why import Why
from logs.recording.paths import DESCRIPTION
from logs.recording.stream import LIVE_PORT, RecordingStream
from world_models.building.world import World
from world_models.camera import Camera, CameraMount
from world_models.entries.body import Frame, MotionReport
from world_models.frames import Pose2


def all_loggers(
    world: World, camera: Camera, mount: CameraMount, line_of: Callable[[Decision], str] = decision_line,
) -> tuple[Logger, ...]:
    """Everything that a recording shows."""
    belief = Belief(world)
    return (
        Building(world), Robots(world, camera, mount, belief), Plan(world), Frames(camera), Image(camera),
        SketchTree(), Lanes(), Decisions(line_of), Errors(belief), Chapters(belief), Why(belief),
    )


class RecordingWriter:
    """Draws every decision.

    It learns of the mission from the decisions alone, and of the true robot, where somebody knows it, from
    :meth:`truth`. On hardware nobody does.
    """

    def __init__(
        self, path: Path | None, *, world: World, camera: Camera, mount: CameraMount, title: str, recording_id: str,
        live: bool = False, live_port: int = LIVE_PORT, line_of: Callable[[Decision], str] = decision_line,
        loggers: Sequence[Logger] | None = None,
    ) -> None:
        """Begin a recording in a file (``path``), for a viewer that connects now (``live``), or both.

        Args:
            line_of: gives a decision's line in the journal; :meth:`JournalFile.line` spares making it twice.
            loggers: what is drawn; all of it unless said.

        Raises:
            RecordingError: the file cannot be written.
            ValueError: neither path nor live.
        """
        self._stream = RecordingStream(
            path, recording_id, title, blueprint(world, camera), live=live, live_port=live_port)
        self._mirror = Mirror()
        self._sim_time_s = 0.0
        self._truth: list[Pose2] = []
        self._loggers = all_loggers(world, camera, mount, line_of) if loggers is None else tuple(loggers)
        self._stream.fix(DESCRIPTION, describe(title))
        for logger in self._loggers:
            logger.begin(self._stream)

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
        self._stream.at(decision.cycle, self._sim_time_s)
        for logger in self._loggers:
            logger.log(self._stream, moment)
        self._stream.end_cycle()

    def flush(self) -> None:
        """Bring everything to the disk, and to whoever watches, now.

        Raises:
            RecordingError: the recording cannot be written any more.
        """
        self._stream.flush()

    def close(self) -> None:
        """End the recording.

        Raises:
            RecordingError: its last part could not be written.
        """
        self._stream.close()

    def _moment(self, decision: Decision) -> Moment:
        moment = Moment(decision, self._mirror, tuple(self._truth))
        self._truth.clear()
        for change in moment.changes:
            self._mirror.take(change)
        times = [*(e.value.sim_time_s for e in moment.changed(Frame)),
                 *(e.value.sim_time_s for e in moment.changed(MotionReport))]
        self._sim_time_s = max([self._sim_time_s, *times])
        return moment
