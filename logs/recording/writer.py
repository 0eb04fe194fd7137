"""RecordingWriter: the scheduler's sink that draws ``recording.rrd`` with every logger that is found."""

from __future__ import annotations

import pkgutil
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from pathlib import Path

from blackboard import Decision, decision_line
from logs.recording import loggers as built_in
from logs.recording.logger import Held, Logger, Moment, Subject, TrueDifference, blueprint
from logs.recording.stream import LIVE_PORT, RecordingStream
from logs.run_errors import RecordingError
from logs.timeline import Mirror, find_belief
from world_models.building.geometry.faces import Face
from world_models.building.world import World
from world_models.camera import Camera, CameraMount
from world_models.entries import CameraPicture, MotionReport, Place
from world_models.frames import Pose2
from world_models.plugins import PluginError, load_plugin_classes

GROUP = "harvey.loggers"
"""Entry points of this group name logger classes of other packages."""


def logger_classes() -> tuple[type[Logger], ...]:
    """Everything that a recording shows: the loggers of the project, then those of other packages.

    Raises RecordingError where a logger of another package cannot be loaded.
    """
    try:
        return (*_find_built_in_loggers(), *load_plugin_classes(GROUP, Logger).values())
    except PluginError as error:
        raise RecordingError(str(error)) from error


def _find_built_in_loggers() -> Iterator[type[Logger]]:
    """Those in the folder ``loggers`` and below it, in the order of their files' names."""
    for module in pkgutil.walk_packages(built_in.__path__, f"{built_in.__name__}."):
        if not module.ispkg:
            yield from import_module(module.name).LOGGERS


class RecordingWriter:
    """Draws each decision when it comes."""

    def __init__(
        self, path: Path | None, *, world: World, camera: Camera, mount: CameraMount, title: str, recording_id: str,
        live: bool = False, live_port: int = LIVE_PORT, line_of: Callable[[Decision], str] = decision_line,
        loggers: Sequence[type[Logger]] | None = None,
    ) -> None:
        """Begin a recording in a file (``path``), for a viewer that connects now (``live``), or both.

        Args:
            line_of: gives a decision's line in the journal; :meth:`JournalFile.line` spares making it twice.
            loggers: classes of what is drawn; all that there are unless said.

        Raises:
            RecordingError: the file cannot be written.
            ValueError: neither path nor live.
        """
        subject = Subject(title, world, camera, mount, line_of)
        self._loggers = tuple(logger(subject) for logger in (logger_classes() if loggers is None else loggers))
        self._stream = RecordingStream(
            path, recording_id, title, blueprint(self._loggers), live=live, live_port=live_port)
        self._world, self._mirror, self._sim_time_s = world, Mirror(), 0.0
        self._held: Held | None = None
        self._truth: Pose2 | None = None
        self._contacts, self._differences, self._happened = list[Place](), list[TrueDifference](), list[str]()
        for logger in self._loggers:
            logger.begin(self._stream)

    def truth(self, world_from_robot: Pose2, sim_time_s: float, contacts: Sequence[Place] = (),
              happened: Sequence[str] = ()) -> None:
        """Where the robot truly is, what it touched, and what was done to it; drawn with the next decision."""
        self._truth = world_from_robot
        self._contacts += contacts
        self._happened += happened
        self._sim_time_s = max(self._sim_time_s, sim_time_s)

    def true_building(self, added: tuple[Face, ...], gone: tuple[Face, ...]) -> None:
        """How the building truly differs from its model from now on; drawn with the next decision."""
        self._differences.append(TrueDifference(added, gone))

    def __call__(self, decision: Decision) -> None:
        """Draw one decision, as long as the recording can be written."""
        self._mirror.take(*decision.observed, *decision.made)
        belief = find_belief(self._mirror)
        if belief is None:
            self._held = None
        elif self._held is None or self._held.value is not belief.value:
            self._held = Held(belief.value, belief.value.world_from_robot(self._world))
        moment = Moment(decision, self._mirror, self._held, self._truth, self._contacts, self._differences,
                        self._happened)
        times_s = [*(e.value.sim_time_s for e in moment.changed(CameraPicture)),
                   *(e.value.sim_time_s for e in moment.changed(MotionReport))]
        self._sim_time_s = max([self._sim_time_s, *times_s])
        self._stream.at(decision.cycle, self._sim_time_s)
        for logger in self._loggers:
            logger.log(self._stream, moment)
        self._stream.end_cycle()
        self._contacts, self._differences, self._happened = [], [], []

    def tell(self, **values: str | int | float) -> None:
        """Properties of the run as a whole, as its outcome; later ones are added."""
        self._stream.tell(**values)

    def flush(self) -> None:
        """Bring everything to the disk and to the viewers now. Raises RecordingError where that fails."""
        self._stream.flush()

    def close(self) -> None:
        """End the recording. Raises RecordingError where a part of it could not be written."""
        self._stream.close()
