"""The plan sketch tree (Figure 3): goal, subgoals and the milestones between them, laid out by us as an outline."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from blackboard.entry import Entry
from logs.recording.board_mirror import Mirror, Moment
from logs.recording.logger import Logger, Panel, Subject
from logs.recording.palette import DONE, PLANNED, VERDICTS, WAITING, Colour
from logs.recording.paths import SKETCH
from logs.recording.stream import REFUTED, VERIFIED, RecordingStream
from world_models.entries.task import Certificate, Goal, Milestone, PlanSketch, Subgoal
from world_models.words import short

ROW, INDENT = 26.0, 34.0
LETTER, BORDER = 5.4, 26.0
"""The graph's own units: height of a row, step to the right of a level, width of a letter and of a node's border."""

NO_SKETCH = "the way there is yet to be sketched"

MARKS: Mapping[str, str] = {
    "verified": VERIFIED, "refuted": REFUTED, "not testable": "?", "turning": "…", "expected": "…", "": "·",
}


@dataclass(frozen=True, slots=True)
class Node:
    """One row of the outline; ``after`` is the row that it hangs on, or ""."""

    id: str
    label: str
    colour: Colour
    depth: int
    after: str


class Tree:
    """Columns of nodes and edges."""

    @classmethod
    def columns(cls, **components: Any) -> Iterator[Any]:
        for name, values in components.items():
            yield from (rr.GraphEdges if name == "edges" else rr.GraphNodes).columns(**{name: values})


class SketchTree(Logger):
    """Logs the whole tree when any of it changes."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._last: list[Node] = []

    def panels(self) -> Sequence[Panel]:
        view = rrb.GraphView(
            origin=SKETCH, name="The plan",
            force_link=rrb.archetypes.ForceLink(enabled=False),
            force_many_body=rrb.archetypes.ForceManyBody(enabled=False),
            force_position=rrb.archetypes.ForcePosition(enabled=False),
            force_collision_radius=rrb.archetypes.ForceCollisionRadius(enabled=False),
            force_center=rrb.archetypes.ForceCenter(enabled=False))
        return (Panel(view, "decisions", 2, 5),)

    def begin(self, stream: RecordingStream) -> None:
        stream.fix(SKETCH, rr.GraphNodes.from_fields(show_labels=True),
                 rr.GraphEdges.from_fields(graph_type="undirected"))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        if not moment.touched(Goal, PlanSketch, Milestone, Certificate):
            return
        nodes = outline(moment.mirror)
        if not nodes or nodes == self._last:
            return
        self._last = nodes
        stream.log(SKETCH, Tree, node_ids=[n.id for n in nodes], positions=_middles(nodes),
                 labels=[n.label for n in nodes], colors=[n.colour for n in nodes],
                 edges=[(n.after, n.id) for n in nodes if n.after])


def outline(mirror: Mirror) -> list[Node]:
    """The rows of the newest goal's tree from top to bottom; finished sketches are folded into their subgoal."""
    goal = mirror.latest(Goal)
    if goal is None:
        return []
    root = Node(goal.id, _goal_label(goal), DONE if goal.value.status == "reached" else PLANNED, 0, "")
    rows = list(_rows(mirror, goal.id, (), root))
    return [root, *rows] if rows else [root, Node(f"{goal.id}/none", NO_SKETCH, WAITING, 1, goal.id)]


def _rows(mirror: Mirror, goal: str, path: tuple[int, ...], parent: Node) -> Iterator[Node]:
    sketch = _sketch(mirror, goal, path)
    if sketch is None or (sketch.value.status == "done" and path):
        return
    last = parent
    for number in range(len(sketch.value.subgoals) + 1):
        last = _milestone_node(mirror, sketch, number, parent.depth + 1, last.id)
        yield last
        if number < len(sketch.value.subgoals):
            last = _subgoal_node(sketch, number, parent.depth + 1, last.id)
            yield last
            yield from _rows(mirror, goal, (*path, number), last)


def _sketch(mirror: Mirror, goal: str, path: tuple[int, ...]) -> Entry[PlanSketch] | None:
    return mirror.latest(PlanSketch, lambda s: s.goal == goal and s.path == path and s.status != "superseded")


def _subgoal_node(sketch: Entry[PlanSketch], number: int, depth: int, after: str) -> Node:
    value = sketch.value
    behind = value.status == "done" or number < value.at
    colour = DONE if behind else PLANNED if number == value.at and value.is_active else WAITING
    return Node(f"{sketch.id}/subgoal-{number}", subgoal_label(value.subgoals[number]), colour, depth, after)


def _milestone_node(mirror: Mirror, sketch: Entry[PlanSketch], number: int, depth: int, after: str) -> Node:
    verdict = _verdict(mirror, sketch, number)
    what = mirror.latest(Milestone, lambda m: m.sketch == sketch.id and m.index == number)
    text = short(what.value.what.removeprefix(f"M{number} ")) if what and what.value.is_open else ""
    label = f"{MARKS.get(verdict, '·')} M{number} {text}".rstrip()
    return Node(f"{sketch.id}/milestone-{number}", label, VERDICTS.get(verdict, WAITING), depth, after)


def _verdict(mirror: Mirror, sketch: Entry[PlanSketch], number: int) -> str:
    """What became of a milestone: what the sketch holds of it counts most, then the last look at it."""
    value = sketch.value
    if number < value.at or (number == value.at and value.verified):
        return "verified"
    last = mirror.latest(Milestone, lambda m: m.sketch == sketch.id and m.index == number)
    return last.value.status if last else ""


def _goal_label(goal: Entry[Goal]) -> str:
    value = goal.value
    return f"{goal.id}: be in {value.destination.locale} ({value.status})"


def subgoal_label(subgoal: Subgoal) -> str:
    """Where a subgoal leads, in a few words."""
    a, b = subgoal.origin, subgoal.destination
    through = f" by {subgoal.passage}" if subgoal.passage else ""
    if a.locale != b.locale:
        return f"to {b.locale}{through}"
    how = "straight to" if subgoal.primitive else f"cross {b.locale} to"
    return f"{how} ({b.x_m:.1f}, {b.y_m:.1f}) m{through}"


def _middles(nodes: list[Node]) -> list[tuple[float, float]]:
    return [(INDENT * n.depth + (BORDER + LETTER * len(n.label)) / 2, ROW * row) for row, n in enumerate(nodes)]


LOGGERS = (SketchTree,)
