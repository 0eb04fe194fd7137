"""RunRecorder: the files that a run writes while it goes on: journal, camera file, recording."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from blackboard import Change, Decision, Effect, Port, Retract, Sink, decision_line
from logs.disk import sync_folder
from logs.journal_file import JournalFile
from logs.mjpeg_file import MjpegFile
from logs.run_directory import RunDirectory
from logs.run_head import RunHead
from world_models.building.geometry.faces import Face
from world_models.building.world import World
from world_models.entries import CameraPicture, Place
from world_models.frames import Pose2
from world_models.robot import RobotModel

if TYPE_CHECKING:
    from logs.recording.writer import RecordingWriter


@dataclass(frozen=True, slots=True)
class Extent:
    """How much of a run's files is whole [bytes]."""

    journal: int = 0
    camera: int = 0


class RunRecorder:
    """Records a run. With neither a directory nor a viewer it records nothing.

    Attributes:
        replaying: while it is set, the run is drawn, but nothing is written to journal and camera file, and the ports
            are not asked.
    """

    def __init__(
        self, run: RunDirectory | None, head: RunHead, world: World, robot: RobotModel, *,
        live: bool = False, whole: Extent | None = None, drawing: Path | None = None, sync: bool = False,
        recording: bool = True,
    ) -> None:
        """Begin the files of a run.

        Args:
            run: where; None keeps neither journal nor pictures.
            live: let a viewer watch.
            whole: go on with the files of a run, of which so much is whole.
            drawing: of a run that is only replayed: where its recording is drawn.
            sync: force what a port acts on, and each picture, onto the disk, so that it outlives a power cut too.
            recording: draw one into the run's directory.

        Raises:
            OSError: a file cannot be written, or another process is writing it.
            RecordingError: the recording cannot be written.
        """
        self.replaying = whole is not None or drawing is not None
        self._journal: JournalFile | None = None
        self._camera: MjpegFile | None = None
        self._drawing: RecordingWriter | None = None
        drawing = run.recording if run is not None and recording else drawing
        with ExitStack() as opened:
            if run is not None:
                run.path.mkdir(parents=True, exist_ok=True)
                keep = whole or Extent()
                self._journal = JournalFile(run.journal, keep=keep.journal, sync=sync)
                opened.callback(self._journal.close)
                if whole is None:  # now that the journal is ours
                    head.write(run.path)
                self._camera = MjpegFile(run.camera, keep=keep.camera, sync=sync)
                opened.callback(self._camera.close)
                if sync:
                    sync_folder(run.path)
            if drawing is not None or live:
                from logs.recording.writer import RecordingWriter  # here, so that a mission without loads no rerun

                line_of = decision_line if self._journal is None else self._journal.line
                self._drawing = RecordingWriter(
                    drawing, world=world, camera=robot.lens, mount=robot.mount, live=live, line_of=line_of,
                    title=f"harvey {head.name}", recording_id=f"{head.name}-{head.seed}")
                opened.callback(self._drawing.close)
                self._drawing.tell(scenario=head.name, seed=head.seed)
            self._opened = opened.pop_all()

    @property
    def sinks(self) -> tuple[Sink, ...]:
        """For the scheduler; the journal comes first."""
        return (self._write, *([self._drawing] if self._drawing else []))

    def record_port(self, port: Port) -> RecordedPort:
        """The port, whose pictures are written before the board sees them."""
        return RecordedPort(self, port)

    def record_picture(self, effect: Effect) -> None:
        """Write a picture, if that is what was observed. Raises CannotWriteError."""
        value = None if isinstance(effect, Retract) else effect.value
        if self._camera is not None and isinstance(value, CameraPicture):
            self._camera.add(value.jpeg)

    def draw_truth(self, pose: Pose2, sim_time_s: float, contacts: Sequence[Place] = (),
                   happened: Sequence[str] = ()) -> None:
        """Where the robot truly is, where it touched something since the last cycle, and what was done to it."""
        if self._drawing is not None:
            self._drawing.truth(pose, sim_time_s, contacts, happened)

    def draw_true_building(self, added: tuple[Face, ...], gone: tuple[Face, ...]) -> None:
        """How the building truly differs from its model from now on: faces that are there besides, and that are not."""
        if self._drawing is not None:
            self._drawing.true_building(added, gone)

    def draw_end(self, outcome: str, error_m: float | None) -> None:
        """How it ended, and how far from the goal in truth; None where nobody knows that."""
        if self._drawing is not None:
            self._drawing.tell(outcome=outcome, **({} if error_m is None else {"error_m": error_m}))

    def close(self) -> None:
        """No more decisions. Raises RecordingError where the recording's last part could not be written."""
        self._opened.close()

    def _write(self, decision: Decision) -> None:
        if self._journal is not None and not self.replaying:
            self._journal(decision)


class RecordedPort:
    """A port whose pictures are recorded.

    Attributes:
        closed: whether it leaves everything unanswered.
    """

    def __init__(self, recorder: RunRecorder, port: Port) -> None:
        self._recorder, self._port = recorder, port
        self.closed = False

    @property
    def name(self) -> str:
        return self._port.name

    def answer(self, change: Change) -> Iterable[Effect]:
        return () if self.closed or self._recorder.replaying else self._answers(change)

    def _answers(self, change: Change) -> Iterator[Effect]:
        for effect in self._port.answer(change):
            self._recorder.record_picture(effect)
            yield effect
