"""Logger: what draws one thing of each moment, and names the panels that show it; the window has those of all."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from typing import Any, Literal, TypeVar

import rerun.blueprint as rrb
from rerun.encodings import TimeRange

from blackboard import Change, Decision, Entry, Retracted, decision_line
from logs.recording.stream import RecordingStream
from logs.timeline import Mirror
from world_models.building.geometry.faces import Face
from world_models.building.world import World
from world_models.camera import Camera, CameraMount
from world_models.entries import Hypothesis, Place
from world_models.frames import Pose2

T = TypeVar("T")

BACKGROUND = rrb.Background(color=[28, 30, 34, 255])
"""Of views in space."""
Area = Literal["words", "world", "decisions", "measurements"]
"""``words``: the column to the left; ``world``: the middle, above; ``decisions``: the middle, below;
``measurements``: the column to the right."""
SHARES, MIDDLE_SHARES = (11, 29, 8), (11, 10)
"""Of the window's width: words to the left, the middle, measurements; of its height there: the world, decisions."""
PLAYED_PER_S = 10.0
"""Cycles, when the recording plays."""
NEAR_CYCLES = 40
"""Lanes and plots show so many cycles to either side of the cursor."""
NEAR = rrb.archetypes.TimeAxis(view_range=TimeRange(
    start=rrb.TimeRangeBoundary.cursor_relative(seq=-NEAR_CYCLES),
    end=rrb.TimeRangeBoundary.cursor_relative(seq=NEAR_CYCLES)))


@dataclass(frozen=True, slots=True)
class TrueDifference:
    """How a building truly differs from its model: faces that are there besides, and faces that are not."""

    added: tuple[Face, ...] = ()
    gone: tuple[Face, ...] = ()


@dataclass(frozen=True, slots=True)
class Held:
    """The hypothesis that is acted on, as it stands on the board, and its pose in the world frame."""

    value: Hypothesis
    world_from_robot: Pose2

    @property
    def sigma_m(self) -> float:
        """The largest standard deviation of the place, in closed form, as it is drawn so often [m]."""
        (a, b, _), (_, d, _), _ = self.value.covariance
        return math.sqrt(max(0.0, (a + d) / 2 + math.hypot((a - d) / 2, b)))


@dataclass(frozen=True)
class Moment:
    """One cycle as the loggers see it.

    Attributes:
        decision: what was decided.
        mirror: the board after it.
        held: the belief that is acted on then; None where there is none, as when the robot is lost.
        truth: where the robot truly is; None where nobody knows.
        contacts: where it truly touched something since the last cycle.
        differences: how the building truly differed from its model since then; empty where that did not change.
        happened: what the simulator did since then, in words.
    """

    decision: Decision
    mirror: Mirror
    held: Held | None = None
    truth: Pose2 | None = None
    contacts: Sequence[Place] = ()
    differences: Sequence[TrueDifference] = ()
    happened: Sequence[str] = ()

    @cached_property
    def changes(self) -> tuple[Change, ...]:
        """What was observed before the decision, then what it made."""
        return (*self.decision.observed, *self.decision.made)

    @cached_property
    def _kinds(self) -> frozenset[type[Any]]:
        return frozenset(type(change.entry.value) for change in self.changes)

    @property
    def off(self) -> Pose2 | None:
        """The belief as seen from the truth, in the true robot's own frame; None where one of them is not known."""
        return self.truth.inverse() @ self.held.world_from_robot if self.truth and self.held else None

    def changed(self, kind: type[T]) -> tuple[Entry[T], ...]:
        """Entries of a type that were posted or revised."""
        if kind not in self._kinds:
            return ()
        return tuple(c.entry for c in self.changes if isinstance(c.entry.value, kind) and not isinstance(c, Retracted))

    def touched(self, *kinds: type[Any]) -> bool:
        """Whether any entry of these types changed or went."""
        return not self._kinds.isdisjoint(kinds)


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


@dataclass(frozen=True, slots=True)
class Subject:
    """What a recording is of.

    Attributes:
        title: of the run.
        world, camera, mount: the robot's model of building and camera.
        line_of: gives a decision's line in the journal.
    """

    title: str
    world: World
    camera: Camera
    mount: CameraMount
    line_of: Callable[[Decision], str] = decision_line


class Logger(ABC):
    """Draws one thing.

    Attributes:
        subject: what the recording is of.
    """

    def __init__(self, subject: Subject) -> None:
        self.subject = subject
        self._last: dict[str, object] = {}

    def panels(self) -> Sequence[Panel]:
        """The views that show it; none where those of other loggers do."""
        return ()

    def begin(self, stream: RecordingStream) -> None:  # noqa: B027  (most loggers have something to log here, not all)
        """Log what holds at all times: shapes, styles."""

    @abstractmethod
    def log(self, stream: RecordingStream, moment: Moment) -> None:
        """Log what this cycle changed."""

    def is_new(self, path: str, what: object) -> bool:
        """Whether something else is to be seen at an entity path from now on."""
        before, self._last[path] = self._last.get(path), what
        return before != what


def log_view(origin: str, name: str, *columns: Literal["loglevel", "body"]) -> Any:
    """Lines of text by cycle."""
    shown = rrb.TextLogColumns(timeline_columns=["cycle"], text_log_columns=columns)
    return rrb.TextLogView(origin=origin, name=name, columns=shown)


def blueprint(loggers: Sequence[Logger]) -> Any:
    """All panels of some loggers under one cursor, in one window."""
    panels = [panel for logger in loggers for panel in logger.panels()]
    middle = _join(rrb.Vertical, [_area(panels, "world", rrb.Horizontal), _area(panels, "decisions", rrb.Horizontal)],
                   MIDDLE_SHARES)
    columns = [_area(panels, "words", rrb.Vertical), middle, _area(panels, "measurements", rrb.Vertical)]
    return window(_join(rrb.Horizontal, columns, SHARES) or rrb.Vertical(), PLAYED_PER_S)


def window(content: Any, played_per_s: float) -> Any:
    """Views under one cursor, with the viewer's own panels folded away."""
    return rrb.Blueprint(
        content, rrb.TimePanel(timeline="cycle", state="collapsed", fps=played_per_s),
        rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed"), auto_views=False)


def _area(panels: Sequence[Panel], area: Area, container: Any) -> Any:
    """The panels of an area in their order, those of equal order as tabs; None where there are none."""
    inside = sorted((panel for panel in panels if panel.area == area), key=lambda panel: (panel.order, -panel.share))
    groups = [list(group) for _, group in groupby(inside, key=lambda panel: panel.order)]
    parts = [group[0].view if len(group) == 1 else rrb.Tabs(*(panel.view for panel in group)) for group in groups]
    return _join(container, parts, [max(panel.share for panel in group) for group in groups])


def _join(container: Any, parts: Sequence[Any], shares: Sequence[float]) -> Any:
    """The parts that there are in a container; None where there are none."""
    there = [(part, share) for part, share in zip(parts, shares, strict=True) if part is not None]
    name = "row_shares" if container is rrb.Vertical else "column_shares"
    return container(*(part for part, _ in there), **{name: [share for _, share in there]}) if there else None
