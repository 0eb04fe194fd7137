"""View updater (§4: models are incomplete): lines that something before the camera hides are not expected."""

from __future__ import annotations

from collections.abc import Iterable

from blackboard import Change, Effect, Entry, Level, Posted, Revise, Revised, View, Watch, rule
from knowledge_sources.methods.verification import list_seen_locales, predict_milestone
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, MILESTONE, find_car_of, find_frames
from world_models.building.locale_frame import FrameRequest
from world_models.entries import Milestone, Obstruction


def find_unjudged(view: View, trigger: Change) -> Entry[Obstruction] | None:
    """What was found, where the picture of the milestone is taken and not judged."""
    return trigger.entry if MILESTONE.of(view).value.status == "expected" else None


@rule(on=Watch(Obstruction, (Posted, Revised)), writes=(Milestone, FrameRequest), needs=(HELD, MILESTONE),
      bind=find_unjudged, priority=Priority.REVISE, level=Level.PLAN)
def view_updater(view: View, case: Entry[Obstruction]) -> Iterable[Effect]:
    """Predicts a milestone again whose picture is taken, without what an obstruction hides that was just found."""
    hidden, milestone, belief = case, MILESTONE.of(view), HELD.of(view)
    robot, pose = belief.seeing, belief.pose
    seen = predict_milestone(robot, pose, milestone.value, find_car_of(view, milestone.value))
    frames = find_frames(view, list_seen_locales(robot, pose, belief.locale))
    yield Revise(milestone, seen, (hidden, milestone, belief.entry, *frames))
