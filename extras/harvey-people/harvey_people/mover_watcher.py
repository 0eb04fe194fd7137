"""Mover watcher: who walks there, by what the static world does not explain in pictures and in echoes of the ring."""

from __future__ import annotations

from collections.abc import Iterable

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revise, View, Watch
from harvey_people.following import follow
from harvey_people.mover import Mover
from harvey_people.sightings import Sighting, list_sightings
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, SURE
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import FreeFloor

Case = tuple[Entry[FreeFloor], tuple[Sighting, ...], tuple[Entry[Mover], ...]]
"""A sight of the floor, what is in it that the model lacks, and whom it may be of."""


class MoverWatcher(RobotKnowledgeSource):
    """Follows what is seen on the floor, and the model lacks, from sight to sight.

    What stands is seen at its place again; what walks is where its velocity takes it. Each sight makes one or the other
    likelier, and says little that another thing may have come into sight instead. Who is out of sight for long, or
    whose place is seen free, is gone.
    """

    level, priority = Level.ACTION, Priority.ENTER  # before what is seen is taken for a thing
    on = (Watch(FreeFloor, (Posted,)),)
    needs = (HELD, SURE)
    writes = (Mover,)

    def bind(self, view: View, trigger: Change) -> Case | None:
        """The sight, where it shows something that the model lacks, or somebody was seen before."""
        seen = tuple(list_sightings(trigger.entry.value))
        known = tuple(view.where(Mover, lambda mover: mover.status != "gone"))
        return (trigger.entry, seen, known) if seen or known else None

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        scan, seen, known = case
        named = max((int(entry.value.name.rpartition("-")[2]) for entry in view.all(Mover)), default=0)
        for step in follow([entry.value for entry in known], seen, scan.value, named):
            if step.before is None:
                yield Post(step.mover, (scan, *known))
            else:
                yield Revise(known[step.before], step.mover, (scan, *known))
