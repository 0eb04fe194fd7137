"""Correlator tracker (§5): follows landmarks by template correlation, and corrects the belief by them.

The place of each landmark in the image is predicted; where its template correlates best, the difference tells how the
motion deviated (Figure 10). New landmarks are taken as old ones leave the view.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from statistics import median

import numpy as np

from blackboard import Change, Effect, Level, Posted, Revise, View, Watch
from knowledge_sources.methods.arrays import Image
from knowledge_sources.methods.calibration import compute_camera_covariance
from knowledge_sources.methods.features import Template
from knowledge_sources.methods.tracking import (
    TEMPLATE_HALF_PX,
    TrackUpdate,
    action_px,
    correct_pose,
    cut_template,
    follow_landmarks,
)
from knowledge_sources.priority import Priority
from knowledge_sources.reads import (
    HELD,
    MEASURED,
    NOT_LOST,
    PICTURE,
    Belief,
    Following,
    Renewed,
    find_camera,
    find_missing_floors,
    find_near_frames,
    find_robot,
    open_discrepancy,
    post_or_revise,
    rectify,
    take_new,
    tell_worst,
    with_anchors,
)
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.building.model_errors import find_sigma_m
from world_models.entries import Anchor, CameraPicture, Discrepancy, Drift, Hypothesis, Track, Tracks, open_or_measure

MAX_MISSES = 2  # a landmark that is not found so many times in a row is dropped
MIN_EXPECTED_LANDMARKS = 4  # fewest expected landmarks that can make a discrepancy
MIN_AGREEING_LANDMARKS = 2  # fewest that must agree for a correction; of 34 found alone two were something else
MIN_AGREEING_PART = 1.0 / 3.0  # if a smaller part of the expected landmarks agrees, tracking has failed
MIN_LANDMARKS = 5  # with fewer tracked landmarks than this, new ones are always taken
ENOUGH_LANDMARKS = 9  # with this many tracked landmarks or more, no new ones are taken
MIN_REMAINING_PART = 0.5  # between these two, new landmarks are taken below this part of those at the last renewal
MIN_DRIFT_STRETCH_M = 0.3  # shortest stretch of way from which the drift of the wheels is learnt (§3.2)


class CorrelatorTracker(RobotKnowledgeSource):
    """Follows landmarks from frame to frame, corrects the belief by them, and posts the size of the correction."""

    level, priority = Level.ACTION, Priority.CORRECT
    closes = Level.ACTION
    on = (Watch(CameraPicture, (Posted,), lambda f: f.purpose == "track"),)
    needs = (HELD, PICTURE, NOT_LOST, MEASURED)
    writes = (Tracks, Hypothesis, Drift, Discrepancy)

    def bind(self, view: View, trigger: Change) -> Following:
        return Following(PICTURE.of(view), HELD.of(view), view.latest(Tracks))

    def act(self, view: View, case: Following) -> Iterable[Effect]:
        frame, held, old = case
        belief, image = held.entry, rectify(held.robot, frame)
        followed = [] if old is None else self._follow(view, held, old.value.items, image)
        seen = [f.track for f in followed if f.track.found_px is not None]
        because = (frame, belief) if old is None else (frame, belief, old)
        corrected, agreeing = self._correct(held, seen, old.value.anchors) if seen and old else (None, 0)
        expected, unseen = sum(1 for f in followed if f.expected), 0 if seen or old is None else old.value.unseen + 1
        bare = find_missing_floors(view, unseen)
        what = f"no landmark in {unseen} pictures, and the floor is nowhere free where it should be" if bare else ""
        if expected >= MIN_EXPECTED_LANDMARKS and agreeing < MIN_AGREEING_PART * expected:
            what = f"{expected - agreeing} of {expected} landmarks are not where they were expected{tell_worst(seen)}"
        if what:
            tracks = [f.track for f in followed]
            yield from self._post_discrepancy(view, what, math.inf, held, tracks, (*because, *bare))
            yield post_or_revise(old, Tracks(frame.id, TEMPLATE_HALF_PX, ()), because)
            return
        if agreeing < MIN_AGREEING_LANDMARKS:
            corrected = None  # nothing confirms that it is not something else that looks the same
        renewed = self._renew(case, image, followed, corrected or belief.value)
        tracked = post_or_revise(old, replace(renewed.tracks, unseen=unseen), because)
        yield tracked
        if corrected is None and renewed.hypothesis is belief.value:
            return
        correction = Revise(belief, renewed.hypothesis, (frame, belief, tracked))
        yield correction
        yield from _learn_drift(view, held, renewed.hypothesis, correction)
        if corrected is not None:
            shift = median(math.dist(t.predicted_px, t.found_px) for t in seen if t.found_px is not None)
            what = f"{len(seen)} landmarks are {shift:.1f} px from where they were expected"
            yield from self._post_discrepancy(view, what, shift, held, seen, (correction,))

    def _follow(self, view: View, belief: Belief, tracks: tuple[Track, ...], image: Image) -> list[TrackUpdate]:
        def template_of(track: Track) -> Template:
            jpeg, robot = view[track.template_frame].value.jpeg, belief.robot
            return cut_template(robot.lens, robot.camera, jpeg, track.template_px, TEMPLATE_HALF_PX)

        return follow_landmarks(belief.seeing, tracks, template_of, image, belief.pose, belief.covariance)

    def _correct(self, held: Belief, seen: list[Track], anchors: tuple[Anchor, ...]) -> tuple[Hypothesis, int]:
        """The belief by landmarks that were found, and how many of them agree with it."""
        pose, covariance, agreeing = correct_pose(
            held.robot, seen, anchors, held.pose, held.covariance, find_sigma_m(held.world, held.locale))
        return held.moved_to(pose, covariance, "tracks"), agreeing

    def _renew(self, case: Following, image: Image, followed: list[TrackUpdate], belief: Hypothesis) -> Renewed:
        """Keep the landmarks that still serve, and take new ones where too few are left."""
        frame, old, robot = case.frame, case.old, case.belief.seeing
        anchors, taken = ((), 0) if old is None else (old.value.anchors, old.value.taken)
        near = find_near_frames(anchors, belief.world_from_robot(robot.world), robot)
        kept = tuple(f.track for f in followed if f.expected and f.track.misses < MAX_MISSES
                     and f.track.template_frame in near)
        if len(kept) >= max(MIN_LANDMARKS, min(ENOUGH_LANDMARKS, MIN_REMAINING_PART * taken)):
            return Renewed(with_anchors(robot, frame.id, kept, anchors, belief, taken), belief)
        camera = compute_camera_covariance(find_camera(case.belief.view))
        return take_new(case.belief, frame.id, image, kept, anchors, belief, camera)

    def _post_discrepancy(
        self, view: View, what: str, magnitude_px: float, belief: Belief, tracks: list[Track],
        because: tuple[object, ...],
    ) -> Iterable[Effect]:
        points, s = np.array([track.point_world for track in tracks]), self._settings
        bounds = action_px(find_robot(view), belief.value, points, s), s.plan.max_deviation_px
        found = Discrepancy(Level.ACTION, what, magnitude_px, bounds, "px")
        last = open_discrepancy(view, Level.ACTION)
        if last is None or not last.value.exceeds:  # one beyond its bound is the discrepancy raiser's
            yield open_or_measure(view, found, because)


def _learn_drift(view: View, before: Belief, belief: Hypothesis, correction: Revise) -> Iterable[Effect]:
    """Learn how the wheels drift, when the robot has gone far enough to tell."""
    drift = view.latest(Drift)
    if drift is None or drift.value.gone_m < MIN_DRIFT_STRETCH_M:
        return
    heading = belief.world_from_robot(before.world).heading_rad
    learnt = drift.value.update(before.robot.actuator, heading, math.sqrt(2.0) * belief.sigma_rad)
    yield Revise(drift, learnt, (drift, correction))
