"""The plan: in the building the goal, the way that the sketches foresee, the leg under way and the landmarks expected;
and the plan sketch tree (Figure 3): goal, subgoals and the milestones between them, laid out by us as an outline."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from blackboard import Entry, View
from logs.recording.logger import Logger, Moment, Panel
from logs.recording.palette import DONE, EXPECTED, PLANNED, VERDICTS, WAITING, Colour, faint
from logs.recording.paths import GOAL, LANDMARKS, LEG, PATH, SKETCH
from logs.recording.stream import REFUTED, VERIFIED, Mixed, RecordingStream
from world_models.entries import Certificate, Goal, Leg, Milestone, Place, PlanSketch, Subgoal
from world_models.words import short

Point = tuple[float, float, float]
FLAG_M = 3.0


class Plan(Logger):
    """Logs goal, sketches, leg and milestone when they change."""

    def begin(self, stream: RecordingStream) -> None:
        stream.fix(GOAL, rr.Arrows3D.from_fields(radii=0.08, colors=[PLANNED], show_labels=True))
        stream.fix(LEG, rr.Arrows3D.from_fields(radii=0.06, colors=[PLANNED]))
        stream.fix(LANDMARKS, rr.LineStrips3D.from_fields(radii=0.03, colors=[EXPECTED]))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        for kind, draw in ((Goal, self._flag), (PlanSketch, self._way), (Leg, self._leg), (Milestone, self._landmarks)):
            if moment.touched(kind):
                draw(stream, moment.mirror)

    def _point(self, place: Place, height_m: float) -> Point:
        pose = place.in_world(self.subject.world)
        return pose.x_m, pose.y_m, height_m

    def _flag(self, stream: RecordingStream, board: View) -> None:
        goals = [e.value for e in board.all(Goal) if e.value.status != "abandoned"]
        tops = [self._point(goal.destination, FLAG_M) for goal in goals]
        stream.log(GOAL, rr.Arrows3D, origins=tops, vectors=[(0.0, 0.0, -FLAG_M)] * len(tops),
                   labels=["goal" if goal.is_active else f"goal ({goal.status})" for goal in goals])

    def _way(self, stream: RecordingStream, board: View) -> None:
        """Each sketch in use as a strip; the first level thin, what lies behind grey."""
        sketches = [e.value for e in board.all(PlanSketch) if e.value.status != "superseded"]
        if not self.is_new(PATH, [(sketch.subgoals, sketch.at, sketch.status) for sketch in sketches]):
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

    def _leg(self, stream: RecordingStream, board: View) -> None:
        last = board.latest(Leg, lambda g: g.status == "moving")
        ends = [(g.x0_m, g.y0_m, g.x1_m - g.x0_m, g.y1_m - g.y0_m) for g in ([last.value] if last else [])]
        if self.is_new(LEG, ends):
            stream.log(LEG, rr.Arrows3D, origins=[(x, y, 0.15) for x, y, _, _ in ends],
                       vectors=[(dx, dy, 0.0) for _, _, dx, dy in ends])

    def _landmarks(self, stream: RecordingStream, board: View) -> None:
        last = board.latest(Milestone)
        lines = last.value.expected if last and last.value.is_open else ()
        if self.is_new(LANDMARKS, lines):
            stream.log(LANDMARKS, rr.LineStrips3D, strips=np.array(lines, np.float32).reshape(-1, 2, 3))


ROW, INDENT = 26.0, 34.0
LETTER, BORDER = 5.4, 26.0
"""The graph's own units: height of a row, step to the right of a level, width of a letter and of a node's border."""
TREE = Mixed(edges=rr.GraphEdges, **dict.fromkeys(("node_ids", "positions", "labels", "colors"), rr.GraphNodes))
NO_SKETCH = "the way there is yet to be sketched"
MARKS: Mapping[str, str] = {
    "verified": VERIFIED, "refuted": REFUTED, "not testable": "?", "turning": "…", "expected": "…", "": "·",
}


@dataclass(frozen=True, slots=True)
class OutlineRow:
    """One row of the outline; ``after`` is the row that it hangs on, or ""."""

    id: str
    label: str
    colour: Colour
    depth: int
    after: str


class SketchTree(Logger):
    """Logs the whole tree when any of it changes."""

    def panels(self) -> Sequence[Panel]:
        forces = ("ForceLink", "ForceManyBody", "ForcePosition", "ForceCollisionRadius", "ForceCenter")
        names = ("force_link", "force_many_body", "force_position", "force_collision_radius", "force_center")
        off = {name: getattr(rrb.archetypes, force)(enabled=False) for name, force in zip(names, forces, strict=True)}
        return (Panel(rrb.GraphView(origin=SKETCH, name="The plan", **off), "decisions", 2, 5),)

    def begin(self, stream: RecordingStream) -> None:
        stream.fix(SKETCH, rr.GraphNodes.from_fields(show_labels=True),
                   rr.GraphEdges.from_fields(graph_type="undirected"))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        if not moment.touched(Goal, PlanSketch, Milestone, Certificate):
            return
        nodes = outline(moment.mirror)
        if nodes and self.is_new(SKETCH, nodes):
            middles = [(INDENT * n.depth + (BORDER + LETTER * len(n.label)) / 2, ROW * i) for i, n in enumerate(nodes)]
            stream.log(SKETCH, TREE, node_ids=[n.id for n in nodes], positions=middles,
                       labels=[n.label for n in nodes], colors=[n.colour for n in nodes],
                       edges=[(n.after, n.id) for n in nodes if n.after])


def outline(board: View) -> list[OutlineRow]:
    """The rows of the newest goal's tree from top to bottom; finished sketches are folded into their subgoal."""
    goal = board.latest(Goal)
    if goal is None:
        return []
    label = f"{goal.id}: be in {goal.value.destination.locale} ({goal.value.status})"
    root = OutlineRow(goal.id, label, DONE if goal.value.status == "reached" else PLANNED, 0, "")
    rows = list(_rows(board, goal.id, (), root))
    return [root, *rows] if rows else [root, OutlineRow(f"{goal.id}/none", NO_SKETCH, WAITING, 1, goal.id)]


def _rows(board: View, goal: str, path: tuple[int, ...], parent: OutlineRow) -> Iterator[OutlineRow]:
    sketch = board.latest(PlanSketch, lambda s: s.goal == goal and s.path == path and s.status != "superseded")
    if sketch is None or (sketch.value.status == "done" and path):
        return
    last, value = parent, sketch.value
    for number in range(len(value.subgoals) + 1):
        last = _milestone_node(board, sketch, number, parent.depth + 1, last.id)
        yield last
        if number < len(value.subgoals):
            behind = value.status == "done" or number < value.at
            colour = DONE if behind else PLANNED if number == value.at and value.is_active else WAITING
            last = OutlineRow(f"{sketch.id}/subgoal-{number}", _subgoal_label(value.subgoals[number]), colour,
                              parent.depth + 1, last.id)
            yield last
            yield from _rows(board, goal, (*path, number), last)


def _milestone_node(board: View, sketch: Entry[PlanSketch], number: int, depth: int, after: str) -> OutlineRow:
    """What the sketch holds of a milestone counts most, then the last look at it."""
    value = sketch.value
    what = board.latest(Milestone, lambda m: m.sketch == sketch.id and m.index == number)
    is_verified = number < value.at or (number == value.at and value.verified)
    verdict = "verified" if is_verified else what.value.status if what else ""
    text = short(what.value.what.removeprefix(f"M{number} ")) if what and what.value.is_open else ""
    label = f"{MARKS.get(verdict, '·')} M{number} {text}".rstrip()
    return OutlineRow(f"{sketch.id}/milestone-{number}", label, VERDICTS.get(verdict, WAITING), depth, after)


def _subgoal_label(subgoal: Subgoal) -> str:
    """Where a subgoal leads, in a few words."""
    a, b = subgoal.origin, subgoal.destination
    through = f" by {subgoal.passage}" if subgoal.passage else ""
    if a.locale != b.locale:
        return f"to {b.locale}{through}"
    how = "straight to" if subgoal.primitive else f"cross {b.locale} to"
    return f"{how} ({b.x_m:.1f}, {b.y_m:.1f}) m{through}"


LOGGERS = (Plan, SketchTree)
