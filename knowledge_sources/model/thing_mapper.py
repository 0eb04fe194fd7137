"""Thing mapper (§4: models are incomplete): what is seen on the floor, and is not in the model, is in the way.

It is seen in pictures of the floor or by range sensors; it is forgotten when its floor is seen free.
"""

from __future__ import annotations

from collections.abc import Iterable

import shapely

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revise, Revised, View, Watch
from knowledge_sources.methods.floor import Sight, is_telling, may_be_there
from knowledge_sources.methods.floor.rivals_on_floor import tell_of_door
from knowledge_sources.methods.floor.weigh_sight import weigh_sight
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, SURE, Belief
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import CameraPicture, Difference, Evidence, FreeFloor, Obstacle


class ThingMapper(RobotKnowledgeSource):
    """Concludes from a sight of the floor that something stands on it; or that it is gone, or no thing.

    What is seen is joined with what is known there already. It is there when it is certain enough, by one sure picture
    or two unsure ones; and gone when most of its footprint is seen to be free
    floor, or it rather is dirt on the lens. Of a jamb that stands beside the wall's end is there, and its door is told.
    """

    level, priority = Level.ACTION, Priority.REVISE
    on = (Watch(FreeFloor, (Posted, Revised)),)
    needs = (HELD, SURE)
    writes = (Obstacle, Evidence)

    def bind(self, view: View, trigger: Change) -> Entry[FreeFloor] | None:
        """A sight with a thing in it that is certain enough, or of floor on which something may be there."""
        scan: Entry[FreeFloor] = trigger.entry
        is_thing = any(is_telling(thing) for thing in scan.value.things)
        is_usable = is_thing or view.latest(Obstacle, may_be_there) is not None
        return scan if is_usable else None

    def act(self, view: View, case: Entry[FreeFloor]) -> Iterable[Effect]:
        scan, belief = case, HELD.of(view)
        known = {entry.id: entry for entry in view.all(Obstacle)}
        obstacles = {id: entry.value for id, entry in known.items()}
        sight = self._tell_of(view, scan, belief)
        for found in weigh_sight(sight, obstacles, self._settings):
            entry = None if found.known is None else known[found.known]
            if found.told is not None:
                of_door = tell_of_door(sight.weigh(found.told), found.told)
                yield from (Post(one, (scan,)) for one in (found.told, of_door) if one is not None)
            if entry is None:
                yield Post(found.obstacle, (scan,))
            else:
                of = (one for one in view.all(Difference) if one.value.about == found.obstacle.name)
                yield Revise(entry, found.obstacle, (scan, entry, *of))

    def _tell_of(self, view: View, scan: Entry[FreeFloor], belief: Belief) -> Sight:
        """A sight with what it is weighed by."""
        pictures = (found.id for ref in scan.because
                    if (found := view.get(ref.id)) is not None and isinstance(found.value, CameraPicture))
        seen_by = next(pictures, scan.id) if scan.value.sense == "camera" else scan.id
        before = [one.value.things for one in view.newest_first(FreeFloor)
                  if one.value.sense == "camera" and one is not scan]
        differences = {entry.value.about: entry.value for entry in view.all(Difference)}
        under = shapely.Point(belief.pose.position).buffer(belief.robot.radius_m)
        return Sight(scan.value, seen_by, belief.world, under, belief.robot.camera, before, differences)
