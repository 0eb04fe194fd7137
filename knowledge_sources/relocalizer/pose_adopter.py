"""Pose adopter (§2): a lost robot's place is found, and becomes its belief."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from blackboard import Change, Effect, Entry, Level, Posted, Retract, Revise, View, Watch, rule
from knowledge_sources.priority import Priority
from knowledge_sources.reads import CAMERA, HELD, LOST, WHILE_LOST
from world_models.building.locale_frame import FrameRequest
from world_models.entries import AliasOdds, CameraState, Hypothesis, PlaceSearch

Found = tuple[Entry[PlaceSearch], Entry[Hypothesis]]


def find_place(view: View, trigger: Change) -> Found | None:
    """A search that found the place, and the only candidate that is left."""
    place = view.latest(Hypothesis, lambda h: h.status == "candidate")
    return None if place is None else (trigger.entry, place)


@rule(on=Watch(PlaceSearch, (Posted,), lambda search: search.status == "found"),
      writes=(Hypothesis, CameraState, AliasOdds, FrameRequest), needs=(*WHILE_LOST, CAMERA), bind=find_place,
      level=Level.GOAL, closes=Level.GOAL, priority=Priority.CORRECT)
def pose_adopter(view: View, case: Found) -> Iterable[Effect]:
    """Takes the place that was found for the belief, and the camera with which it was found.

    The odds of the old place against its aliases say nothing of the one that was found, and end.
    """
    (search, place), belief, camera = case, HELD.of(view), CAMERA.of(view)
    before, now = belief.pose, place.value.world_from_robot(belief.world)
    held = replace(place.value, status="held", weight=1.0, motion=belief.value.motion,
                   correction=before.inverse() @ now)
    yield Revise(belief.entry, held, (search, place, LOST.of(view), belief.entry))
    yield Retract(place, (search,))
    yield from (Retract(odds, (search,)) for odds in view.all(AliasOdds))
    found_with = camera.value.as_nominal() if search.value.is_camera_nominal else camera.value
    if found_with != camera.value:
        yield Revise(camera, found_with, (search, camera))
