"""Door toucher (§4: models are incomplete): what was touched in an opening that looks shut is a leaf."""

from __future__ import annotations

import math
from collections.abc import Iterable

from blackboard import Change, Effect, Entry, Revise, Revised, View, Watch, rule
from knowledge_sources.methods.doors import is_in_opening, touch_door
from knowledge_sources.methods.floor import locate_touch
from knowledge_sources.priority import Priority
from knowledge_sources.reads import GOING_ON, HELD, UP_TO_DATE, find_frames, last_motion
from knowledge_sources.reads.questions import list_touches
from world_models.building.locale_frame import FrameRequest
from world_models.entries import Contact, DoorState, Hypothesis

MARGIN_SIGMAS = 3.0  # standard deviations of where it was touched that this keeps from the jambs


Touched = tuple[Entry[Contact], Entry[DoorState]]


def find_touched_door(view: View, _trigger: Change) -> Touched | None:
    """The contact that ended the last motion, and the door that may be shut and was touched in its opening."""
    belief, contact, last = HELD.of(view), view.latest(Contact), last_motion(view)
    if contact is None or last is None or contact not in list_touches(view) or contact.because[0].id != last.id:
        return None
    doors = view.where(DoorState, lambda d: d.may_be_shut and d.touched_s is None and belief.locale in d.between)
    if not doors:
        return None
    radius_m, b = belief.robot.radius_m, belief.value
    at = locate_touch(belief.pose, radius_m, contact.value, 0.0).at
    margin_m = MARGIN_SIGMAS * math.hypot(b.sigma_m, radius_m * math.hypot(b.sigma_rad, contact.value.sigma_rad))
    (frame,) = find_frames(view, {belief.locale})
    touched = {d.name for d in frame.value.doorways if is_in_opening(d, belief.locale, at, margin_m)}
    door = next((entry for entry in doors if entry.value.door in touched), None)
    return None if door is None else (contact, door)


@rule(on=Watch(Hypothesis, (Revised,), lambda h: h.is_held), writes=(DoorState, FrameRequest),
      needs=(GOING_ON, HELD, UP_TO_DATE), bind=find_touched_door, priority=Priority.REVISE)
def door_toucher(view: View, case: Touched) -> Iterable[Effect]:
    """Adds a touch to what is believed of a door that may be shut, where it was in its opening; once a door.

    A touch has nothing in common with pictures. Alone it shuts no door: a thing may stand in its opening.
    """
    contact, door = case
    yield Revise(door, touch_door(door.value, contact.value.when_s), (contact, HELD.of(view).entry, door))
