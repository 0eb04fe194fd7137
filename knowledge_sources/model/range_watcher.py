"""Range watcher (§4: models are incomplete): how far the floor is free, by range sensors."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice

from blackboard import Change, Effect, Entry, Level, Post, Posted, View, Watch
from knowledge_sources.methods.floor import see_ranges
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, SURE, UP_TO_DATE
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import FreeFloor, Ranges

MAX_BELIEF_SIGMA_M = 0.15  # a less certain place tells of no free floor
MAX_RANGE_AGE_S = 5.0  # a reading is compared with those that are no older
MAX_EARLIER_READINGS = 4  # readings that the newest is compared with


class RangeWatcher(RobotKnowledgeSource):
    """Concludes from a reading of range sensors where the floor is free, and what ends it.

    It acts after the correlator tracker has corrected the belief by the picture of the same moment, and only while the
    robot knows where it is: as long as its place is in doubt, an echo may be of a wall.
    """

    level, priority = Level.ACTION, Priority.ADVANCE
    on = (Watch(Ranges, (Posted,)),)
    needs = (HELD, UP_TO_DATE, SURE)
    writes = (FreeFloor,)

    def bind(self, view: View, trigger: Change) -> Entry[Ranges] | None:
        """The newest reading, where a belief is held that is sharp enough to tell whether an echo is of a wall."""
        is_newest = view.latest(Ranges) is trigger.entry
        is_usable = self._settings.floor.use_ranges and is_newest and HELD.of(view).value.sigma_m <= MAX_BELIEF_SIGMA_M
        return trigger.entry if is_usable else None

    def act(self, view: View, case: Entry[Ranges]) -> Iterable[Effect]:
        reading, belief = case, HELD.of(view)
        b = belief.value
        before = (entry for entry in view.newest_first(FreeFloor) if entry.value.sense == "ranges")
        earlier = tuple(entry for entry in islice(before, MAX_EARLIER_READINGS)
                        if reading.value.when_s - entry.value.seen_s <= MAX_RANGE_AGE_S)
        floor = see_ranges(belief.robot, b.locale, belief.pose, b.sigma_m, b.sigma_rad, reading.value,
                           [entry.value for entry in earlier])
        yield Post(floor, (reading, belief.entry, *earlier[:1]))
