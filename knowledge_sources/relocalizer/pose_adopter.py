"""Pose adopter (§2): a lost robot's place is found, and becomes its belief."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from blackboard import Change, Effect, Entry, Level, Posted, Retract, Revise, View, Watch
from knowledge_sources.priority import Priority
from knowledge_sources.reads import WHILE_LOST, Lost, find_building, find_lost
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import CameraState, Hypothesis, PlaceSearch, TwinOdds


class Case(NamedTuple):
    """A search that found the place, the only candidate that is left, what was believed, and the camera as learnt.

    Attributes:
        odds: those of the place where it was believed to be, against its twins, if any were kept.
    """

    search: Entry[PlaceSearch]
    place: Entry[Hypothesis]
    lost: Lost
    camera: Entry[CameraState]
    odds: tuple[Entry[TwinOdds], ...]


class PoseAdopter(RobotKnowledgeSource):
    """Takes the place that was found for the belief, and the camera with which it was found.

    What pictures told of the old place against its twins tells nothing of the one that was found, and ends.
    """

    level = closes = Level.GOAL
    priority = Priority.CORRECT
    on = (Watch(PlaceSearch, (Posted,), lambda search: search.status == "found"),)
    needs = WHILE_LOST
    writes = (Hypothesis, CameraState, TwinOdds)

    def bind(self, view: View, trigger: Change) -> Case | None:
        place, camera = view.latest(Hypothesis, lambda h: h.status == "candidate"), view.latest(CameraState)
        odds = view.all(TwinOdds)
        return None if place is None or camera is None else Case(trigger.entry, place, find_lost(view), camera, odds)

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        search, place, (doubt, belief), camera, odds = case
        building = find_building(view)
        before, now = (h.value.world_from_robot(building) for h in (belief, place))
        held = replace(place.value, status="held", weight=1.0, motion=belief.value.motion,
                       correction=before.inverse() @ now)
        yield Revise(belief, held, (search, place, doubt, belief))
        yield Retract(place, (search,))
        yield from (Retract(old, (search,)) for old in odds)
        found_with = camera.value.as_told() if search.value.is_camera_as_told else camera.value
        if found_with != camera.value:
            yield Revise(camera, found_with, (search, camera))
