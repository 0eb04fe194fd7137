"""Logger: what draws one thing, and names the panels that show it and their places in the window."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import rerun.blueprint as rrb
from rerun.encodings import TimeRange

from blackboard.journal import Decision, decision_line
from logs.recording.board_mirror import Belief, Moment
from logs.recording.stream import RecordingStream
from world_models.building.world import World
from world_models.camera import Camera, CameraMount

Area = Literal["words", "world", "decisions", "measurements"]
"""``words``: the column to the left; ``world``: the middle, above; ``decisions``: the middle, below;
``measurements``: the column to the right."""

NEAR_CYCLES = 40
"""Lanes and plots show so many cycles to either side of the cursor."""

NEAR = rrb.archetypes.TimeAxis(view_range=TimeRange(
    start=rrb.TimeRangeBoundary.cursor_relative(seq=-NEAR_CYCLES),
    end=rrb.TimeRangeBoundary.cursor_relative(seq=NEAR_CYCLES)))


@dataclass(frozen=True, slots=True)
class Panel:
    """A view and its place.

    Attributes:
        view: a view of rerun's blueprint.
        area: the part of the window.
        order: the place in its area, counted from the top or from the left; panels of the same order are tabs,
            that of the largest share in front.
        share: of the area's length.
    """

    view: Any
    area: Area = "measurements"
    order: int = 100
    share: float = 5.0


def log_view(origin: str, name: str, *columns: Literal["loglevel", "body"]) -> Any:
    """Lines of text by cycle."""
    shown = rrb.TextLogColumns(timeline_columns=["cycle"], text_log_columns=columns)
    return rrb.TextLogView(origin=origin, name=name, columns=shown)


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
