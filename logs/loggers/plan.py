"""The plan in the building: the goal, the way that the sketches foresee, the leg under way, the landmarks expected."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import rerun as rr

from logs.mirror import Mirror, Moment
from logs.palette import DONE, EXPECTED, PLANNED, faint
from logs.paths import GOAL, LANDMARKS, LEG, PATH
from logs.tape import Tape
from world_models.location import Place
from world_models.task import Goal, Leg, Milestone, PlanSketch
from world_models.world import World

Point = tuple[float, float, float]

FLAG_M = 3.0


class Plan:
    """Logs goal, sketches, leg and milestone when they change."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._drawn: tuple[tuple[type[Any], str, Callable[[Mirror], Any]], ...] = (
            (Goal, GOAL, self._flag), (PlanSketch, PATH, self._way), (Leg, LEG, _leg),
            (Milestone, LANDMARKS, _landmarks))

    def begin(self, tape: Tape) -> None:
        """Nothing holds at all times."""

    def log(self, tape: Tape, moment: Moment) -> None:
        for kind, path, draw in self._drawn:
            if moment.touched(kind):
                tape.log(path, draw(moment.mirror))

    def _point(self, place: Place, height_m: float) -> Point:
        pose = place.in_world(self._world)
        return pose.x_m, pose.y_m, height_m

    def _flag(self, mirror: Mirror) -> Any:
        goals = [e.value for e in mirror.all(Goal) if e.value.status != "abandoned"]
        tops = [self._point(goal.destination, FLAG_M) for goal in goals]
        return rr.Arrows3D(origins=tops, vectors=[[0, 0, -FLAG_M]] * len(tops), radii=0.08, colors=[PLANNED],
                           labels=[f"goal ({goal.status})" for goal in goals], show_labels=True)

    def _way(self, mirror: Mirror) -> Any:
        """Each sketch in use as a strip; the first level thin, what lies behind grey."""
        strips, colours, radii = [], [], []
        for sketch in (e.value for e in mirror.all(PlanSketch) if e.value.status != "superseded"):
            thick = 0.05 if sketch.path else 0.02
            for number, subgoal in enumerate(sketch.subgoals):
                behind = sketch.status == "done" or number < sketch.at
                strips.append([self._point(p, 0.03 + thick) for p in (subgoal.origin, subgoal.destination)])
                colours.append(faint(DONE, 160) if behind else faint(PLANNED, 255 if sketch.path else 110))
                radii.append(thick)
        return rr.LineStrips3D(strips, colors=colours, radii=radii)


def _leg(mirror: Mirror) -> Any:
    legs = [e.value for e in mirror.all(Leg) if e.value.status == "moving"][-1:]
    return rr.Arrows3D(origins=[(g.x0_m, g.y0_m, 0.15) for g in legs],
                       vectors=[(g.x1_m - g.x0_m, g.y1_m - g.y0_m, 0.0) for g in legs], radii=0.06, colors=[PLANNED])


def _landmarks(mirror: Mirror) -> Any:
    last = mirror.latest(Milestone)
    lines = last.value.expected if last and last.value.is_open else ()
    return rr.LineStrips3D(np.array(lines, float).reshape(-1, 2, 3), colors=[EXPECTED], radii=0.03)
