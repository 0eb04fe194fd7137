"""A small mission played by scripted knowledge sources: a room, a door, another room."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from blackboard import (
    Change,
    Effect,
    KnowledgeSource,
    Level,
    Post,
    Retract,
    Revise,
    Scheduler,
    Sink,
    View,
    Watch,
    inference,
)
from world_models.building.world import World
from world_models.camera import Camera, CameraMount
from world_models.entries import (
    LADDER,
    CameraPicture,
    Certificate,
    Discrepancy,
    Goal,
    Hypothesis,
    Leg,
    LineMatch,
    Milestone,
    MotionReport,
    MotorCommand,
    Outcome,
    PictureRequest,
    Place,
    PlanSketch,
    PoseFix,
    Segments,
    Subgoal,
    Track,
    Tracks,
    diagonal,
)
from world_models.entries.entry_kinds import KINDS
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world
from world_models.frames import Pose2

HOUSE = """
name = "house"
units = "metres"
[finishes]
paint = { colour = [0.8, 0.7, 0.6] }
[defaults]
walls = "paint"
floor = "paint"
ceiling = "paint"
baseboard = "paint"
moulding = "paint"
frame = "paint"
leaf = "paint"
threshold = "paint"
height = 2.7
door_width = 1.0
door_height = 2.0
[locales.kitchen]
kind = "room"
size = [4, 4]
[locales.parlour]
kind = "room"
at = [4.2, 0]
size = [4, 4]
[doors]
kitchen-door = { between = ["kitchen", "parlour"], wall = "east", along = 2, open = true }
"""

CAMERA = Camera.from_field_of_view(math.radians(65.0))
MOUNT = CameraMount(1.0, 0.1)
WRITES = (Goal, PlanSketch, Leg, Milestone, Certificate, Outcome, Tracks, Segments, LineMatch, PoseFix, Hypothesis,
          MotorCommand, PictureRequest, Discrepancy)

Line = Callable[[View], Iterable[Effect]]


def house() -> World:
    """Two rooms and a door."""
    return read_world(Source.parse(HOUSE, "house.toml"))


@inference()
@dataclass(frozen=True, slots=True)
class Cue:
    """Triggers a line of the script: whose it is, and its number."""

    who: str
    line: int


class Player(KnowledgeSource):
    """A knowledge source that acts by the script when its cue comes."""

    def __init__(self, called: str, level: Level, lines: Sequence[Line]) -> None:
        self._called, self._lines = called, lines
        self.level = level
        self.on = (Watch(Cue, where=lambda cue: cue.who == called),)
        self.writes = WRITES

    @property
    def name(self) -> str:
        return self._called

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        return self._lines[trigger.entry.value.line](view)


def picture(number: int) -> CameraPicture:
    """A grey picture that differs from the next one."""
    _, jpeg = cv2.imencode(".jpg", np.full((512, 512, 3), 60 + 5 * number, np.uint8))
    return CameraPicture(jpeg.tobytes(), number, 0.5 * number, "track")


def play(sinks: Sequence[Sink], before: Callable[[int], None] = lambda _number: None) -> Scheduler:
    """Play it all; ``before`` is called before each line with its number."""
    lines: list[Line] = []
    cast = {"interpreter": Level.GOAL, "sketcher": Level.PLAN, "judge": Level.PLAN, "motor": Level.ACTION,
            "tracker": Level.ACTION, "clumsy": Level.ACTION}
    players = [Player(name, level, lines) for name, level in cast.items()]
    scheduler = Scheduler(players, sinks=sinks, ladder=LADDER, kinds=KINDS)
    for number, (who, line, observed) in enumerate(SCRIPT):
        lines.append(line)
        before(number)
        scheduler.post([Post(value) for value in observed], "body")
        scheduler.post([Post(Cue(who, number))], "prompter")
        while scheduler.step() is not None:
            pass
    return scheduler


def _last(view: View, kind: type[Any]) -> Any:
    entry = view.latest(kind)
    assert entry is not None
    return entry


def _place(x: float, y: float, room: str = "kitchen") -> Place:
    return Place(room, x, y)


def _interpret(_view: View) -> Iterable[Effect]:
    goal = Post(Goal(_place(1, 1), _place(2, 2, "parlour")))
    yield goal
    yield Post(Hypothesis("kitchen", Pose2(1.0, 1.0, 0.0), diagonal(0.02, 0.01), "command"), (goal,))


def _sketch(view: View) -> Iterable[Effect]:
    goal = _last(view, Goal)
    route = (Subgoal(_place(1, 1), _place(1, 2, "parlour"), False, "kitchen-door"),
             Subgoal(_place(1, 2, "parlour"), _place(2, 2, "parlour"), True))
    top = Post(PlanSketch(goal.id, (), "", route), (goal,))
    yield top
    yield Post(PlanSketch(goal.id, (0,), "kitchen", (Subgoal(_place(1, 1), _place(3, 2), True),)), (top,))


LINES_PX = (((100.0, 50.0), (100.0, 400.0)), ((-80.0, 20.0), (700.0, 300.0)))
LINES_WORLD = (((4.0, 1.5, 0.0), (4.0, 1.5, 2.0)), ((4.0, 1.5, 2.0), (4.0, 2.5, 2.0)))


def _expect(view: View) -> Iterable[Effect]:
    sketch = _last(view, PlanSketch)
    expected = Milestone(
        sketch.id, 0, "the door", 0.0, ("kitchen-door",), LINES_WORLD, LINES_PX, (0, 0), status="expected")
    yield Post(expected, (sketch,))


def _find(view: View) -> Iterable[Effect]:
    frame, milestone = _last(view, CameraPicture), _last(view, Milestone)
    found = np.array([[[101.0, 60.0], [101.0, 390.0]], [[5.0, 20.0], [600.0, 290.0]], [[-9.0, -9.0], [-1.0, -1.0]]])
    yield Post(Segments(frame.id, milestone.id, found, np.full(3, 0.3), 40.0), (frame,))
    pairs = np.array([[0, 0], [1, 1]])
    lines = np.array(LINES_WORLD)
    match = Post(LineMatch(milestone.id, "Segments-1", pairs, lines, found[:2], 0.1, np.ones(2)), (frame,))
    yield match
    yield Post(PoseFix("LineMatch-1", Pose2(1.02, 1.0, 0.01), 1e-4 * np.eye(3), np.array([True, False]),
                       np.ones((2, 2)), ("", "9 px away")), (match,))


def _judge(view: View) -> Iterable[Effect]:
    milestone, sketch = _last(view, Milestone), _last(view, PlanSketch)
    yield Revise(milestone, replace(milestone.value, status="verified"))
    yield Post(Certificate(milestone.id, "PoseFix-1", "verified", "2 of 2 lines", 2, 2, 1, 0.9, 0.5, 0.02, 0.01, 1.5,
                           30.0, 1e-6, 1e-6, 0.006), (milestone,))
    yield Revise(sketch, replace(sketch.value, verified=True))


def _drive(view: View) -> Iterable[Effect]:
    sketch = _last(view, PlanSketch)
    leg = Post(Leg(sketch.id, 0, 1.0, 1.0, 3.0, 2.0, 0.1), (sketch,))
    yield leg
    yield Post(MotorCommand(0.4, 0.6), (leg,))


def _track(view: View) -> Iterable[Effect]:
    frame, belief = _last(view, CameraPicture), _last(view, Hypothesis)
    yield Revise(belief, Hypothesis("kitchen", Pose2(1.5, 1.3, 0.4), diagonal(0.03, 0.01), "tracks"), (frame,))
    points = (Track("kitchen-door", (4.0, 1.5, 2.0), frame.id, (9.0, 9.0), 3.0, (200.0, 90.0), (204.0, 92.0), 0.9, 0.2),
              Track("kitchen-door", (4.0, 2.5, 2.0), frame.id, (9.0, 9.0), 3.0, (505.0, 90.0), None, 0.3, 0.2, 1),
              Track("kitchen-door", (4.0, 2.5, 0.0), frame.id, (9.0, 9.0), 3.0, (900.0, 90.0), None, 0.0, 0.2, 1))
    yield Post(Tracks(frame.id, 10, points, ()), (frame,))
    yield Post(Discrepancy(Level.ACTION, "the door is not where it was expected", 40.0, (12.0, 30.0), "px"), (frame,))


def _escalate(view: View) -> Iterable[Effect]:
    found = _last(view, Discrepancy)
    closed, above = found.value.escalated()
    yield Revise(found, closed)
    yield Post(above, (found,))


def _lose(view: View) -> Iterable[Effect]:
    yield Revise(_last(view, Hypothesis), replace(_last(view, Hypothesis).value, status="candidate", weight=0.7))
    yield Post(Hypothesis("parlour", Pose2(1.0, 1.0, 0.0), diagonal(0.2, 0.1), "relocalization", "candidate", 0.3))


def _stumble(_view: View) -> Iterable[Effect]:
    raise RuntimeError("fell over its own feet")


def _end(view: View) -> Iterable[Effect]:
    yield Retract(_last(view, Tracks))
    yield Revise(_last(view, Goal), replace(_last(view, Goal).value, status="reached"))
    yield Post(Outcome("reached", "there"), (_last(view, Goal),))


SCRIPT: tuple[tuple[str, Line, tuple[Any, ...]], ...] = (
    ("interpreter", _interpret, ()),
    ("sketcher", _sketch, ()),
    ("sketcher", _expect, ()),
    ("judge", _find, (picture(0),)),
    ("judge", _judge, ()),
    ("motor", _drive, ()),
    ("tracker", _track, (MotionReport(0.4, 0.6, 2.0, 2.0), picture(5))),
    ("tracker", _escalate, ()),
    ("clumsy", _stumble, ()),
    ("judge", _lose, ()),
    ("interpreter", _end, ()),
)
