"""Sketch advancer (§3.3, Figure 3): a subgoal is done, so its sketch goes on to the next milestone."""

from __future__ import annotations

from collections.abc import Iterable

from blackboard import Change, Effect, Entry, Level, Revise, Revised, View, Watch, rule
from knowledge_sources.priority import Priority
from world_models.entries import Leg, PlanSketch

Done = Entry[Leg] | Entry[PlanSketch]


def find_sketch(view: View, trigger: Change) -> tuple[Done, Entry[PlanSketch]] | None:
    """The leg or the sketch that is done, and the sketch whose current subgoal it carried out."""
    done = trigger.entry
    for sketch in view.newest_first(PlanSketch):
        if sketch.value.is_active and done.value.carries_out(sketch.id, sketch.value):
            return done, sketch
    return None


@rule(on=(Watch(Leg, (Revised,), lambda leg: leg.status == "arrived"),
          Watch(PlanSketch, (Revised,), lambda sketch: sketch.status == "done" and bool(sketch.path))),
      writes=PlanSketch, bind=find_sketch, level=Level.PLAN, priority=Priority.ADVANCE)
def sketch_advancer(_view: View, case: tuple[Done, Entry[PlanSketch]]) -> Iterable[Effect]:
    """Takes a sketch on to its next milestone when the leg, or the sketch, that carried out its subgoal is done."""
    done, sketch = case
    yield Revise(sketch, sketch.value.advanced(), (done,))
