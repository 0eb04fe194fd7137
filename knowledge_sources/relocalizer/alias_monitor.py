"""Alias monitor (§4): is the robot where it believes, or in a place that looked the same until now?"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from blackboard import Change, Discrepancy, Effect, Entry, Level, Post, Posted, Revise, View, Watch
from knowledge_sources.methods.localization import (
    MIN_NEW_VIEW_RAD,
    MOVE_M,
    CameraView,
    are_distinct,
    compute_pose_likelihood,
    compute_prior,
    compute_twin_odds,
    find_repetitions,
    make_alias_test,
)
from knowledge_sources.priority import Priority
from knowledge_sources.reads import count_refuted, find_belief, find_building, find_robot_in, is_over, open_discrepancy
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Certificate, Hypothesis, PoseFix, Segments, Twin, TwinOdds
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel


class Case(NamedTuple):
    """A verified milestone with its pose and its picture, the belief, and the odds that are known, if any are."""

    certificate: Entry[Certificate]
    fix: Entry[PoseFix]
    looked: Entry[Segments]
    belief: Entry[Hypothesis]
    known: Entry[TwinOdds] | None


class AliasMonitor(RobotKnowledgeSource):
    """Keeps the odds of the believed place against the places that look like it, by every verified milestone.

    The first milestone is verified in each of many identical rooms. What the robot was told speaks for one of them;
    the others are kept in mind, and go with it wherever it drives: each as it would be if the robot had begun there.
    Every further picture, from another view, is weighed at all of them, once. Where another one is likelier, the robot
    doubts its place at the goal level, and looks round.
    """

    level, priority = Level.PLAN, Priority.REVISE
    on = (Watch(Certificate, (Posted,), lambda c: c.verdict == "verified"),)
    writes = (TwinOdds, Discrepancy)

    def bind(self, view: View, trigger: Change) -> Case | None:
        belief, fix = find_belief(view), view.get(trigger.entry.value.fix)
        if is_over(view) or open_discrepancy(view, Level.GOAL) is not None or belief is None or fix is None:
            return None
        known, match = view.latest(TwinOdds), view.get(fix.value.match)
        looked = None if match is None else view.get(match.value.segments)
        is_new = known is None or (known.value.twins and self._is_new(known.value, fix.value))
        return Case(trigger.entry, fix, looked, belief, known) if is_new and looked is not None else None

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        certificate, fix, looked, belief, known = case
        robot, here = find_robot_in(view, belief.value.locale), fix.value.world_from_robot
        s = self._settings.localization
        if known is None:
            p_prior = compute_prior(count_refuted(view), s)
            twins = self._find_twins(view, robot, belief.value, here)
        else:
            p_prior, twins = known.value.p_prior, known.value.twins
        weighed = self._weigh(robot, looked.value, here, twins)
        odds = compute_twin_odds([twin.log_ratio for twin in weighed], p_prior)
        kept = tuple(twin for twin, p in zip(weighed, odds[1:], strict=True) if p >= s.min_p_twin)
        counted = (*(() if known is None else known.value.counted), certificate.id)
        found = TwinOdds(p_prior, odds[0], kept, counted, here)
        because = (certificate, fix, looked, belief)
        change = Post(found, because) if known is None else Revise(known, found, (*because, known))
        yield change
        if odds[0] < s.min_p_tracked:
            yield Post(Discrepancy(Level.GOAL, f"it may be elsewhere: {found.sentence()}", None, (0.0, 0.0), "px"),
                       (change,))

    def _is_new(self, known: TwinOdds, fix: PoseFix) -> bool:
        """Whether a picture shows something else than the last that was counted."""
        pose = fix.world_from_robot
        turn = abs(wrap_angle(pose.heading_rad - known.last.heading_rad))
        return pose.distance_to(known.last) >= 0.5 * MOVE_M or turn >= MIN_NEW_VIEW_RAD

    def _find_twins(self, view: View, robot: RobotModel, belief: Hypothesis, here: Pose2) -> tuple[Twin, ...]:
        """The places of the floor that look like the believed one by walls and doors."""
        building = find_building(view)
        container, level_m = building.locale(belief.locale).parent or belief.locale, building.floor_m(belief.locale)
        rooms = building.list_rooms_in(container, level_m, self._settings.goal.max_floor_difference_m)
        building.require(rooms)
        if belief.locale not in rooms:
            return ()
        nearest = [belief.locale, *(room for room in rooms if room != belief.locale)][:self._settings.goal.max_rooms]
        back = here.inverse()
        found = dict[Pose2, str]()
        for room, there in find_repetitions(robot.world, belief.locale, here, nearest):
            if all(are_distinct(there, other) for other in (here, *found)):
                found[there] = room
        return tuple(Twin(room, there @ back, 0.0) for there, room in found.items())

    def _weigh(self, robot: RobotModel, looked: Segments, here: Pose2, twins: tuple[Twin, ...]) -> tuple[Twin, ...]:
        """The twins with what this picture says of them: less what is noise for those that look the same from here."""
        unmoved = Pose2(0.0, 0.0, 0.0)
        seen = [CameraView(looked.segments_px, unmoved, np.zeros((3, 3)))]
        look_alike = make_alias_test(robot, [unmoved], self._settings)
        own = compute_pose_likelihood(robot, seen, here, self._settings).log_likelihood
        weighed = []
        for twin in twins:
            there = twin.there_from_here @ here
            ratio = compute_pose_likelihood(robot, seen, there, self._settings).log_likelihood - own
            if look_alike(here, there):
                ratio = math.copysign(max(0.0, abs(ratio) - self._settings.localization.alike_log_noise), ratio)
            weighed.append(replace(twin, log_ratio=twin.log_ratio + ratio))
        return tuple(weighed)
