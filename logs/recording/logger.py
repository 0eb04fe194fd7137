"""Logger: what draws one thing, and names the panels that show it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from blackboard.journal import Decision, decision_line
from logs.recording.belief import Belief
from logs.recording.board_mirror import Moment
from logs.recording.panel import Panel
from logs.recording.stream import RecordingStream
from world_models.building.world import World
from world_models.camera import Camera, CameraMount


@dataclass(frozen=True, slots=True)
class Subject:
    """What a recording is of.

    Attributes:
        title: of the run.
        world, camera, mount: the robot's model of building and camera.
        belief: the pose hypothesis that is acted on, placed in the world.
        line_of: gives a decision's line in the journal.
    """

    title: str
    world: World
    camera: Camera
    mount: CameraMount
    belief: Belief
    line_of: Callable[[Decision], str] = decision_line


class Logger(ABC):
    """Draws one thing.

    Attributes:
        subject: what the recording is of.
    """

    def __init__(self, subject: Subject) -> None:
        self.subject = subject

    def panels(self) -> Sequence[Panel]:
        """The views that show it; none where those of other loggers do."""
        return ()

    def begin(self, stream: RecordingStream) -> None:  # noqa: B027  (most loggers have something to log here, not all)
        """Log what holds at all times: shapes, styles."""

    @abstractmethod
    def log(self, stream: RecordingStream, moment: Moment) -> None:
        """Log what this cycle changed."""
