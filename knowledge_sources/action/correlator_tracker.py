"""Correlator tracker (§5): follows landmarks by template correlation, and corrects the belief by them.

The place of each landmark in the image is predicted; where its template correlates best, the difference tells how the
motion deviated (Figure 10). New landmarks are taken as old ones leave the view.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from statistics import median
from typing import NamedTuple

import numpy as np

from blackboard.board import View
from blackboard.change import Change, Posted, Revised, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.entry import Entry
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from knowledge_sources.methods.arrays import Image
from knowledge_sources.methods.features.correlation import Template
from knowledge_sources.methods.features.picture import read_picture
from knowledge_sources.methods.tracking.edge_alignment import align_to_edges
from knowledge_sources.methods.tracking.template_tracking import (
    TrackUpdate,
    correct_pose,
    cut_template,
    follow_landmarks,
    select_landmarks,
)
from knowledge_sources.methods.verification.line_check import find_errors
from knowledge_sources.questions import (
    find_belief,
    find_building,
    find_robot,
    find_robot_in,
    open_discrepancy,
    unmeasured_doubt,
)
from knowledge_sources.robot_knowledge_source import OlderSource
from knowledge_sources.tolerances import action_px
from world_models.entries.body import CameraPicture
from world_models.entries.location import Hypothesis, covariance_tuple
from world_models.entries.percepts import Anchor, Track, Tracks
from world_models.entries.robot_state import Drift
from world_models.visibility.lines_and_points import visible_lines

MIN_LANDMARKS = 5  # with fewer tracked landmarks than this, new ones are always taken
ENOUGH_LANDMARKS = 9  # with this many tracked landmarks or more, no new ones are taken
MIN_REMAINING_PART = 0.5  # between these two, new landmarks are taken below this part of those at the last renewal
MAX_TEMPLATE_DISTANCE_M = 1.3
"""A template is dropped when the robot is further than this from where it was cut: two increments (Table 1:
increments of two feet)."""
MAX_TEMPLATE_DISTANCE_ROLLING_M = 0.8  # the same on the move, where many pictures show the same template
MIN_DRIFT_STRETCH_M = 0.3  # shortest stretch of way from which the drift of the wheels is learnt (§3.2)
MIN_EDGE_LENGTH_PX = 16.0  # shortest projected model edge that the belief is aligned with before templates are cut
MIN_EDGE_CONTRAST = 0.05  # smallest contrast of such an edge
MAX_EDGE_DISTANCE_M = 15.0  # largest distance of such an edge


class Corrected(NamedTuple):
    """The belief after tracking, and how many landmarks agree with it."""

    hypothesis: Hypothesis
    agreeing: int


class Renewed(NamedTuple):
    """The tracks, and the belief by which the new ones of them were cut."""

    tracks: Tracks
    hypothesis: Hypothesis


class CorrelatorTracker(OlderSource):
    """Follows landmarks from frame to frame, corrects the belief by them, and posts the size of the correction."""

    level = Level.ACTION
    closes = Level.ACTION
    on = (
        Watch(CameraPicture, (Posted,), lambda f: f.purpose == "track"),
        Watch(Hypothesis, (Revised,), lambda h: h.is_held and h.basis in ("milestone", "relocalization")),
    )
    writes = (Tracks, Hypothesis, Drift, Discrepancy)

    def judge(self, view: View, trigger: Change) -> float | None:
        if find_belief(view) is None or view.latest(CameraPicture) is None:
            return None
        if open_discrepancy(view, Level.GOAL) is not None:
            return None
        if unmeasured_doubt(view) is not None:  # tracking failed: the plan level looks where the robot is
            return None
        return 0.9

    def answer(self, view: View, trigger: Change) -> Iterable[Effect]:
        frame, belief, old = view.latest(CameraPicture), find_belief(view), view.latest(Tracks)
        if belief is None or frame is None:
            return
        if isinstance(trigger.entry.value, Hypothesis):
            yield from self._begin_anew(view, frame, belief, old)
        else:
            yield from self._track(view, frame, belief, old)

    def _track(
        self, view: View, frame: Entry[CameraPicture], belief: Entry[Hypothesis], old: Entry[Tracks] | None
    ) -> Iterable[Effect]:
        """Follow the landmarks into a new frame; correct the belief, or post that tracking failed."""
        image = _read_picture(view, frame)
        followed = self._follow(view, None if old is None else old.value, image, belief.value)
        seen = [f.track for f in followed if f.track.found_px is not None]
        because = (frame, belief) if old is None else (frame, belief, old)
        corrected = self._correct(view, belief.value, seen, old.value.anchors) if seen and old is not None else None
        expected = sum(1 for f in followed if f.expected)
        agreeing = 0 if corrected is None else corrected.agreeing
        if self._has_failed(expected, agreeing):
            what = f"{expected - agreeing} of {expected} landmarks are not where they were expected{_furthest(seen)}"
            tracks = [f.track for f in followed]
            yield from self._post_discrepancy(view, what, math.inf, belief.value, tracks, because)
            yield _post_or_revise(old, Tracks(frame.id, self._settings.tracking.template_half_px, ()), because)
            return
        if agreeing < self._settings.action.min_agreeing_landmarks:
            corrected = None  # nothing bears out that it is not something else that looks the same
        renewed = self._renew(view, frame, image, followed, belief.value if corrected is None else corrected.hypothesis,
                              old)
        tracked = _post_or_revise(old, renewed.tracks, because)
        yield tracked
        if corrected is None and renewed.hypothesis is belief.value:
            return
        correction = Revise(belief, renewed.hypothesis, (frame, belief, tracked))
        yield correction
        yield from self._learn_drift(view, renewed.hypothesis, correction)
        if corrected is not None:
            shift = median(math.dist(t.predicted_px, t.found_px) for t in seen if t.found_px is not None)
            what = f"{len(seen)} landmarks are {shift:.1f} px from where they were expected"
            yield from self._post_discrepancy(view, what, shift, belief.value, seen, (correction,))

    def _has_failed(self, expected: int, agreeing: int) -> bool:
        """Whether too few of the expected landmarks agree with any one pose."""
        s = self._settings.action
        return expected >= s.min_expected_landmarks and agreeing < s.min_agreeing_part * expected

    def _begin_anew(
        self, view: View, frame: Entry[CameraPicture], belief: Entry[Hypothesis], old: Entry[Tracks] | None
    ) -> Iterable[Effect]:
        """Take all landmarks anew after a milestone or a relocalization."""
        fresh = self._take_new(view, frame, _read_picture(view, frame), (), (), belief.value)
        tracks = _post_or_revise(old, fresh.tracks, (frame, belief))
        yield tracks
        drift = view.latest(Drift)
        if drift is not None:
            heading = fresh.hypothesis.world_from_robot(find_building(view)).heading_rad
            yield Revise(drift, drift.value.restart(heading), (tracks,))
        if fresh.hypothesis is not belief.value:
            yield Revise(belief, fresh.hypothesis, (frame, belief, tracks))

    def _learn_drift(self, view: View, belief: Hypothesis, correction: Revise) -> Iterable[Effect]:
        """Learn how the wheels drift, when the robot has gone far enough to tell."""
        drift = view.latest(Drift)
        if drift is None or drift.value.gone_m < MIN_DRIFT_STRETCH_M:
            return
        robot = find_robot(view)
        heading = belief.world_from_robot(robot.world).heading_rad
        learnt = drift.value.update(robot.actuator, heading, math.sqrt(2.0) * belief.sigma_rad)
        yield Revise(drift, learnt, (drift, correction))

    def _follow(self, view: View, tracks: Tracks | None, image: Image, belief: Hypothesis) -> list[TrackUpdate]:
        if tracks is None:
            return []
        robot, s = find_robot_in(view, belief.locale), self._settings
        pinhole = find_robot(view).camera

        def template_of(track: Track) -> Template:
            jpeg = view[track.template_frame].value.jpeg
            return cut_template(robot.lens, pinhole, jpeg, track.template_px, s.tracking.template_half_px, s.features)

        return follow_landmarks(robot, tracks.items, template_of, image, belief.world_from_robot(robot.world),
                                belief.covariance_world(robot.world), s)

    def _correct(self, view: View, belief: Hypothesis, seen: list[Track], anchors: tuple[Anchor, ...]) -> Corrected:
        """The belief after the landmarks were found."""
        robot = find_robot(view).on_floor_of(belief.locale)
        world = robot.world
        pose, covariance, agreeing = correct_pose(
            robot, seen, anchors, belief.world_from_robot(world), belief.covariance_world(world), self._settings)
        hypothesis = Hypothesis.of_world(world, belief.locale, pose, covariance, "tracks", motion=belief.motion)
        return Corrected(hypothesis, agreeing)

    def _renew(
        self, view: View, frame: Entry[CameraPicture], image: Image, followed: list[TrackUpdate], belief: Hypothesis,
        old: Entry[Tracks] | None,
    ) -> Renewed:
        """Keep the landmarks that still serve, and take new ones where too few are left."""
        s, anchors = self._settings.action, () if old is None else old.value.anchors
        near = self._find_near_frames(view, anchors, belief)
        kept = tuple(f.track for f in followed if f.expected and f.track.misses < s.max_misses
                     and f.track.template_frame in near)
        taken = 0 if old is None else old.value.taken
        if len(kept) >= max(MIN_LANDMARKS, min(ENOUGH_LANDMARKS, MIN_REMAINING_PART * taken)):
            return Renewed(self._with_anchors(view, kept, anchors, frame, belief, taken), belief)
        return self._take_new(view, frame, image, kept, anchors, belief)

    def _take_new(
        self, view: View, frame: Entry[CameraPicture], image: Image, kept: tuple[Track, ...],
        anchors: tuple[Anchor, ...],
        belief: Hypothesis,
    ) -> Renewed:
        """Take new landmarks beside those that are kept, once the belief is aligned with the model's edges."""
        robot = find_robot_in(view, belief.locale)
        world = robot.world
        pose = belief.world_from_robot(world)
        lines = visible_lines(
            world, robot.camera, robot.camera_from_world(pose), min_length_px=MIN_EDGE_LENGTH_PX,
            min_contrast=MIN_EDGE_CONTRAST, max_distance_m=MAX_EDGE_DISTANCE_M,
        )
        found = None
        if find_errors(robot, lines).is_exact:  # else the edges are not where the model has them
            found = align_to_edges(robot, image, lines.lines_world, pose, belief.covariance_world(world),
                                   self._settings.tracking)
        if found is not None:
            pose = found.world_from_robot
            belief = Hypothesis.of_world(world, belief.locale, pose, found.covariance, "tracks", motion=belief.motion)
        items = (*kept, *select_landmarks(robot, kept, frame.id, image, pose, self._settings))
        return Renewed(self._with_anchors(view, items, anchors, frame, belief, len(items)), belief)

    def _find_near_frames(self, view: View, anchors: tuple[Anchor, ...], belief: Hypothesis) -> frozenset[str]:
        """The frames that were taken near enough to here for their templates to be used."""
        robot = find_robot(view)
        here = belief.world_from_robot(robot.world)
        far_m = MAX_TEMPLATE_DISTANCE_ROLLING_M if robot.continuous else MAX_TEMPLATE_DISTANCE_M
        return frozenset(a.frame for a in anchors if math.hypot(a.x_m - here.x_m, a.y_m - here.y_m) <= far_m)

    def _with_anchors(
        self, view: View, items: tuple[Track, ...], anchors: tuple[Anchor, ...], frame: Entry[CameraPicture],
        belief: Hypothesis, taken: int,
    ) -> Tracks:
        """The tracks, with what was believed where their templates were cut."""
        building = find_building(view)
        pose = belief.world_from_robot(building)
        here = Anchor(frame.id, pose.x_m, pose.y_m, covariance_tuple(belief.covariance_world(building)))
        used = {t.template_frame for t in items}
        half_px = self._settings.tracking.template_half_px
        return Tracks(frame.id, half_px, items, tuple(a for a in (*anchors, here) if a.frame in used), taken)

    def _post_discrepancy(
        self, view: View, what: str, magnitude_px: float, belief: Hypothesis, tracks: list[Track],
        because: tuple[object, ...],
    ) -> Iterable[Effect]:
        points = np.array([track.point_world for track in tracks])
        bounds = (action_px(find_robot(view), belief, points, self._settings), self._settings.plan.max_deviation_px)
        found = Discrepancy(Level.ACTION, what, magnitude_px, bounds, "px")
        last = open_discrepancy(view, Level.ACTION)
        if last is None or not last.value.exceeds:  # one beyond its bound is the discrepancy raiser's
            yield Post(found, because) if last is None else Revise(last, found, because)


def _read_picture(view: View, frame: Entry[CameraPicture]) -> Image:
    """The rectified picture of a frame."""
    robot = find_robot(view)
    return read_picture(frame.value.jpeg).rectified(robot.lens, robot.camera)


def _post_or_revise(old: Entry[Tracks] | None, tracks: Tracks, because: tuple[object, ...]) -> Effect:
    return Post(tracks, because) if old is None else Revise(old, tracks, because)


def _furthest(seen: list[Track]) -> str:
    """The landmark that is furthest from where it was expected, in words."""
    off = [(math.dist(t.predicted_px, t.found_px), t.landmark) for t in seen if t.found_px is not None]
    return f" ({max(off)[1]} is {max(off)[0]:.1f} px off)" if off else " (none of them is found)"
