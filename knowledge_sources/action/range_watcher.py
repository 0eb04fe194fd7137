"""Range watcher (§4: models are incomplete): how far the floor is free, by range sensors."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice

from blackboard.board import View
from blackboard.change import Change, Posted, Watch
from blackboard.effect import Effect, Post
from blackboard.entry import Entry
from blackboard.level import Level
from knowledge_sources.methods.floor.ranges import see_ranges
from knowledge_sources.questions import find_belief, find_robot, is_in_doubt, is_up_to_date
from knowledge_sources.robot_knowledge_source import OlderSource
from world_models.entries.floor import FreeFloor
from world_models.entries.obstacle import Ranges

MAX_BELIEF_SIGMA_M = 0.15  # a less certain place tells of no free floor
MAX_RANGE_AGE_S = 5.0  # a reading is compared with those that are no older
MAX_EARLIER_READINGS = 4  # readings that the newest is compared with


class RangeWatcher(OlderSource):
    """Concludes from a reading of range sensors where the floor is free, and what ends it.

    It acts after the tracker has corrected the belief by the picture of the same moment, and only while the robot knows
    where it is: as long as its place is in doubt, an echo may be of a wall.
    """

    level = Level.ACTION
    on = (Watch(Ranges, (Posted,)),)
    writes = (FreeFloor,)

    def judge(self, view: View, trigger: Change) -> float | None:
        s, belief = self._settings.floor, find_belief(view)
        if not s.use_ranges or belief is None or is_in_doubt(view) or not is_up_to_date(view):
            return None
        return 0.6 if view.latest(Ranges) is trigger.entry and belief.value.sigma_m <= MAX_BELIEF_SIGMA_M else None

    def answer(self, view: View, trigger: Change) -> Iterable[Effect]:
        reading: Entry[Ranges] = trigger.entry
        belief = find_belief(view)
        if belief is None:
            return
        robot, b = find_robot(view), belief.value
        pose = b.world_from_robot(robot.world)
        before = (entry for entry in view.newest_first(FreeFloor) if entry.value.sense == "ranges")
        earlier = tuple(entry for entry in islice(before, MAX_EARLIER_READINGS)
                        if reading.value.when_s - entry.value.seen_s <= MAX_RANGE_AGE_S)
        floor = see_ranges(robot, b.locale, pose, b.sigma_m, b.sigma_rad, reading.value,
                           [entry.value for entry in earlier])
        yield Post(floor, (reading, belief, *earlier[:1]))
