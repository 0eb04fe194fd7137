"""Detour finder (§4: models are incomplete): a leg was halted before floor that is not seen; is there another way?"""

from __future__ import annotations

from collections.abc import Iterable

from blackboard import Change, Effect, Entry, Level, Post, Revised, View, Watch
from knowledge_sources.priority import Priority
from knowledge_sources.reads import (
    GOAL,
    HELD,
    find_first_level,
    find_obstacles,
    find_planner,
    find_way_to_goal,
    name_obstacles,
    place_of,
    supersede,
)
from knowledge_sources.reads.sketches import MAX_ADJUSTMENTS, list_lookouts, plan_door_look
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import DoorState, Impasse, Leg, PlanSketch

Halted = tuple[Entry[Leg], Entry[PlanSketch]]


class DetourFinder(RobotKnowledgeSource):
    """Has the sketch drawn again when a leg was halted before what may stand in floor that is not seen.

    Before a door that may be shut it sees no way on until that was looked at from elsewhere, if it can be. Else it does
    so as often in a row as a subgoal may be repeated, and as long as a way leads to the goal round all that may
    stand there.
    """

    level, priority = Level.PLAN, Priority.ADVANCE
    on = (Watch(Leg, (Revised,), lambda leg: leg.status == "halted"),)
    needs = (GOAL, HELD)
    writes = (PlanSketch, Impasse)

    def bind(self, view: View, trigger: Change) -> Halted | None:
        """The leg, and the first-level sketch of which it is a part."""
        sketch, drawn = view.get(trigger.entry.value.sketch), find_first_level(view)
        if sketch is None or drawn is None or not sketch.value.is_active:
            return None
        return (trigger.entry, drawn) if trigger.entry.value.carries_out(sketch.id, sketch.value) else None

    def act(self, view: View, case: Halted) -> Iterable[Effect]:
        (leg, drawn), goal, belief = case, GOAL.of(view), HELD.of(view).entry
        planner = find_planner(view, self._settings.plan)
        door = next((entry for ref in leg.because if isinstance((entry := view[ref.id]).value, DoorState)), None)
        if door is not None and len(list_lookouts(view, goal.id)) < self._settings.plan.max_lookouts and (
                plan_door_look(view, planner, belief.value, door.value) is not None):
            yield Post(Impasse("blocked", door.value.sentence(), goal.id, (door.id,)), (leg, belief, door))
            return
        leads_there = find_way_to_goal(planner, belief.value, goal.value) is not None
        if leads_there and drawn.value.halts < MAX_ADJUSTMENTS:
            yield from supersede(view, leg, "halted")
            return
        obstacles, here = find_obstacles(view), place_of(belief.value)
        reason = f"something may stand in floor that is not seen, before {here.words()}{name_obstacles(obstacles)}"
        yield Post(Impasse("blocked", reason, goal.id, tuple(o.id for o in obstacles)), (leg, belief, *obstacles))
