"""Mover watcher: who walks there, by what the static world does not explain in pictures and in echoes of the ring."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import shapely

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revise, View, Watch
from harvey_people.seeing.following import follow
from harvey_people.seeing.mover import Mover
from harvey_people.seeing.sightings import Sighting, list_sightings
from knowledge_sources.methods.belief import to_probability
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, SURE
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import FloorThing, FreeFloor

Case = tuple[Entry[FreeFloor], tuple[Sighting, ...], tuple[Entry[Mover], ...]]
"""A sight of the floor, what is in it that the model lacks, and whom it may be of."""
NEAR_M = 0.6
"""What is seen so near to somebody's middle is of that one."""


class MoverWatcher(RobotKnowledgeSource):
    """Follows what is seen on the floor, and the model lacks, from sight to sight.

    What stands is seen at its place again; what walks is where its velocity takes it. Each sight makes one or the other
    likelier, and says little that another thing may have come into sight instead. Who is out of sight for long, or
    whose place is seen free, is gone. What is of somebody who may walk is a thing only as far as that one may stand: so
    the sight is revised before the model is.
    """

    level, priority = Level.ACTION, Priority.ENTER  # before what is seen is taken for a thing
    on = (Watch(FreeFloor, (Posted,)),)
    needs = (HELD, SURE)
    writes = (Mover, FreeFloor)

    def bind(self, view: View, trigger: Change) -> Case | None:
        """The sight, where it shows something that the model lacks, or somebody was seen before."""
        seen = tuple(list_sightings(trigger.entry.value))
        known = tuple(view.where(Mover, lambda mover: mover.status != "gone"))
        return (trigger.entry, seen, known) if seen or known else None

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        scan, seen, known = case
        named = max((int(entry.value.name.rpartition("-")[2]) for entry in view.all(Mover)), default=0)
        steps = follow([entry.value for entry in known], seen, scan.value, named)
        for step in steps:
            if step.before is None:
                yield Post(step.mover, (scan, *known))
            else:
                yield Revise(known[step.before], step.mover, (scan, *known))
        people = [step.mover for step in steps if step.mover.seen_s == scan.value.seen_s]
        things = tuple(weigh(thing, people) for thing in scan.value.things)
        if things != scan.value.things:
            grounds = tuple(entry for ref in scan.because if (entry := view.get(ref.id)) is not None)
            yield Revise(scan, replace(scan.value, things=things), (scan, *grounds, *known))


def weigh(thing: FloorThing, people: Iterable[Mover]) -> FloorThing:
    """What is seen on the floor, with the probability that it is there and stands."""
    polygon = shapely.Polygon(thing.footprint)
    walks = (find_p_walks(mover) for mover in people
             if polygon.distance(shapely.Point(mover.x_m, mover.y_m)) <= NEAR_M)
    return replace(thing, p_thing=round(thing.p_thing * (1.0 - max(walks, default=0.0)), 4))


def find_p_walks(mover: Mover) -> float:
    """How probably somebody walks, or will go on; at least a half while it is not known to stand."""
    return max(0.5, float(to_probability(mover.log_odds))) if mover.may_go_on else 0.0
