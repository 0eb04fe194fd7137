"""Sketch advancer (§3.3, Figure 3): a subgoal is done, so its sketch comes to the next milestone."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from blackboard import Change, Effect, Entry, Level, Revise, Revised, View, Watch
from knowledge_sources.priority import Priority
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Leg, PlanSketch


class Case(NamedTuple):
    """The leg or the sketch that is done, and the sketch whose current subgoal it carried out."""

    done: Entry[Leg] | Entry[PlanSketch]
    sketch: Entry[PlanSketch]


class SketchAdvancer(RobotKnowledgeSource):
    """Takes a sketch on to its next milestone when the leg, or the sketch, that carried out its subgoal is done."""

    level, priority = Level.PLAN, Priority.ADVANCE
    on = (
        Watch(Leg, (Revised,), lambda leg: leg.status == "arrived"),
        Watch(PlanSketch, (Revised,), lambda sketch: sketch.status == "done" and bool(sketch.path)),
    )
    writes = (PlanSketch,)

    def bind(self, view: View, trigger: Change) -> Case | None:
        done = trigger.entry
        for sketch in view.newest_first(PlanSketch):
            if sketch.value.is_active and done.value.carries_out(sketch.id, sketch.value):
                return Case(done, sketch)
        return None

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        yield Revise(case.sketch, case.sketch.value.advanced(), (case.done,))
