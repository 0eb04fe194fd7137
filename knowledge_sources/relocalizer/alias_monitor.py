"""Alias monitor (§4): is the robot where it believes, or in a place that looked the same until now?"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revise, View, Watch
from knowledge_sources.methods.localization import (
    ALIKE_LOG_NOISE,
    MAX_FLOOR_DIFFERENCE_M,
    MAX_ROOMS,
    MIN_NEW_VIEW_RAD,
    MIN_P_TRACKED,
    MOVE_M,
    CameraView,
    are_distinct,
    compute_pose_likelihood,
    compute_prior,
    find_repetitions,
    make_alias_test,
    weigh_alias_odds,
)
from knowledge_sources.priority import Priority
from knowledge_sources.reads import GOING_ON, HELD, NOT_LOST, Belief, count_refuted, declare_lost
from knowledge_sources.reads.place_believed import MIN_P_ALIAS
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Alias, AliasOdds, Certificate, Discrepancy, PoseFix, Segments
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel


class Case(NamedTuple):
    """A verified milestone with its pose and its picture, and the odds that are known, if any are."""

    certificate: Entry[Certificate]
    fix: Entry[PoseFix]
    looked: Entry[Segments]
    known: Entry[AliasOdds] | None


class AliasMonitor(RobotKnowledgeSource):
    """Keeps the odds of the believed place against the places that look like it, by every verified milestone.

    The first milestone is verified in each of many identical rooms. The robot's prior supports one of them;
    the others are kept in mind, and go with it wherever it drives: each as it would be if the robot had begun there.
    Every further picture, from another view, is weighed at all of them, once. Where another one is likelier, the robot
    doubts its place at the goal level, and looks round.
    """

    level, priority = Level.PLAN, Priority.REVISE
    on = (Watch(Certificate, (Posted,), lambda c: c.verdict == "verified"),)
    needs = (GOING_ON, HELD, NOT_LOST)
    writes = (AliasOdds, Discrepancy)

    def bind(self, view: View, trigger: Change) -> Case | None:
        fix = view.get(trigger.entry.value.fix)
        if fix is None:
            return None
        known, match = view.latest(AliasOdds), view.get(fix.value.match)
        looked = None if match is None else view.get(match.value.segments)
        is_new = known is None or (known.value.aliases and self._is_new(known.value, fix.value))
        return Case(trigger.entry, fix, looked, known) if is_new and looked is not None else None

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        (certificate, fix, looked, known), belief = case, HELD.of(view)
        robot, here = belief.seeing, fix.value.world_from_robot
        if known is None:
            p_prior = compute_prior(count_refuted(view))
            aliases = self._find_aliases(belief, robot, here)
        else:
            p_prior, aliases = known.value.p_prior, known.value.aliases
        weighed = self._weigh(robot, looked.value, here, aliases)
        odds = weigh_alias_odds([alias.log_ratio for alias in weighed], p_prior)
        kept = tuple(alias for alias, p in zip(weighed, odds[1:], strict=True) if p >= MIN_P_ALIAS)
        counted = (*(() if known is None else known.value.counted), certificate.id)
        found = AliasOdds(p_prior, odds[0], kept, counted, here)
        because = (certificate, fix, looked, belief.entry)
        change = Post(found, because) if known is None else Revise(known, found, (*because, known))
        yield change
        if odds[0] < MIN_P_TRACKED:
            yield declare_lost(f"it may be elsewhere: {found.sentence()}", (change,))

    def _is_new(self, known: AliasOdds, fix: PoseFix) -> bool:
        """Whether a picture shows something else than the last that was counted."""
        pose = fix.world_from_robot
        turn = abs(wrap_angle(pose.heading_rad - known.last.heading_rad))
        return pose.distance_to(known.last) >= 0.5 * MOVE_M or turn >= MIN_NEW_VIEW_RAD

    def _find_aliases(self, belief: Belief, robot: RobotModel, here: Pose2) -> tuple[Alias, ...]:
        """The places of the floor that look like the believed one by walls and doors."""
        building = belief.world
        container, level_m = building.locale(belief.locale).parent or belief.locale, building.floor_m(belief.locale)
        rooms = building.list_rooms_in(container, level_m, MAX_FLOOR_DIFFERENCE_M)
        building.require(rooms)
        if belief.locale not in rooms:
            return ()
        nearest = [belief.locale, *(room for room in rooms if room != belief.locale)][:MAX_ROOMS]
        back = here.inverse()
        found = dict[Pose2, str]()
        for room, there in find_repetitions(robot.world, belief.locale, here, nearest):
            if all(are_distinct(there, other) for other in (here, *found)):
                found[there] = room
        return tuple(Alias(room, there @ back, 0.0) for there, room in found.items())

    def _weigh(self, robot: RobotModel, looked: Segments, here: Pose2, aliases: tuple[Alias, ...]) -> tuple[Alias, ...]:
        """The aliases with what this picture says of them: less where only noise separates them from here."""
        unmoved = Pose2(0.0, 0.0, 0.0)
        seen = [CameraView(looked.segments_px, unmoved, np.zeros((3, 3)))]
        are_aliases = make_alias_test(robot, [unmoved])
        own = compute_pose_likelihood(robot, seen, here).log_likelihood
        weighed = []
        for alias in aliases:
            there = alias.there_from_here @ here
            ratio = compute_pose_likelihood(robot, seen, there).log_likelihood - own
            if are_aliases(here, there):
                ratio = math.copysign(max(0.0, abs(ratio) - ALIKE_LOG_NOISE), ratio)
            weighed.append(replace(alias, log_ratio=alias.log_ratio + ratio))
        return tuple(weighed)
