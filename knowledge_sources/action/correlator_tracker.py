"""Correlator tracker (§5): landmarks are followed by template correlation, and correct the belief while moving.

Before each increment the motion of each landmark in the image is predicted; the difference between the prediction and
the place where its template correlates best tells how the motion deviated (Figure 10). New landmarks are taken as old
ones leave the view.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import lru_cache
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
from knowledge_sources.methods.features.correlation import Template, extract_template
from knowledge_sources.methods.features.rectification import Rectifier
from knowledge_sources.methods.tracking.edge_alignment import align_to_edges
from knowledge_sources.methods.tracking.template_tracking import (
    TrackUpdate,
    correct_pose,
    follow_landmarks,
    select_landmarks,
)
from knowledge_sources.questions import held, open_discrepancy, standing_in, unmeasured_doubt
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from knowledge_sources.settings import DEFAULT
from knowledge_sources.tolerances import PLAN_PX, action_px
from world_models.entries.body import Frame
from world_models.entries.location import Hypothesis, covariance_tuple
from world_models.entries.percepts import Anchor, Track, Tracks
from world_models.entries.wheels import Drift
from world_models.robot import RobotModel
from world_models.visibility.lines_and_points import visible_lines

FEW, FEWEST, LEFT_PART = 9, 5, 0.5
"""New landmarks are taken where fewer than FEWEST are left; or fewer than FEW, and than this part of those that there
were when new ones were last taken."""
FAR_M, FAR_ON_THE_MOVE_M = 1.3, 0.8
"""A template is given up when the robot is so far from where it was cut: it would look otherwise from here. Two of the
paper's increments (two feet each, Table 1) are less. With thirty pictures a second new ones cost little, and one that
has begun to look otherwise draws many pictures aside in a row."""
MISSES = 2
"""A landmark that is not found so often in a row is given up."""
LEAST = 4
"""Fewer expected landmarks than this do not make a discrepancy."""
STRETCH_M = 0.3
"""Over so much way at the least is it learnt how the wheels drift."""
LENGTH_PX, CONTRAST = 16.0, 0.05
"""Model lines that are shorter, or have less contrast, say little of where templates are cut."""
LOST_PART = 1.0 / 3.0
"""When fewer than this part of the expected landmarks agree, tracking cannot explain what it sees."""


class Corrected(NamedTuple):
    """The belief after tracking, and how many landmarks agree with it."""

    hypothesis: Hypothesis
    agreeing: int


class Renewed(NamedTuple):
    """The tracks, and the belief by which the new ones of them were cut."""

    tracks: Tracks
    hypothesis: Hypothesis


class CorrelatorTracker(RobotKnowledgeSource):
    """Follows landmarks from frame to frame; revises the held hypothesis; posts what it had to correct."""

    level = Level.ACTION
    closes = Level.ACTION
    watches = (
        Watch(Frame, (Posted,), lambda f: f.purpose == "track"),
        Watch(Hypothesis, (Revised,), lambda h: h.is_held and h.basis in ("milestone", "relocalization")),
    )
    writes = (Tracks, Hypothesis, Drift, Discrepancy)

    def __init__(self, robot: RobotModel) -> None:
        super().__init__(robot)
        self._picture = Rectifier(robot.lens, robot.camera)
        self._template = lru_cache(maxsize=4 * DEFAULT.tracking.max_tracks)(self._cut)

    def rate(self, view: View, trigger: Change) -> float | None:
        if held(view) is None or view.latest(Frame) is None or open_discrepancy(view, Level.GOAL) is not None:
            return None
        if unmeasured_doubt(view) is not None:  # it could not explain what it saw; others look for where the robot is
            return None
        return 0.9

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        frame, belief, old = view.latest(Frame), held(view), view.latest(Tracks)
        if belief is None or frame is None:
            return
        if isinstance(trigger.entry.value, Hypothesis):
            yield from self._begun_anew(view, frame, belief, old)
            return
        image = self._picture(frame.value.jpeg)
        followed = self._followed(view, None if old is None else old.value, image, belief.value)
        seen = [f.track for f in followed if f.track.found_px is not None]
        expected = sum(1 for f in followed if f.expected)
        because = (frame, belief) if old is None else (frame, belief, old)
        corrected = self._corrected(belief.value, seen, old.value.anchors) if seen and old is not None else None
        agreeing = 0 if corrected is None else corrected.agreeing
        if expected >= LEAST and agreeing < LOST_PART * expected:
            what = f"{expected - agreeing} of {expected} landmarks are not where they were expected{_furthest(seen)}"
            yield from self._told(view, what, math.inf, belief.value, [f.track for f in followed], because)
            yield self._kept(old, Tracks(frame.id, DEFAULT.tracking.template_half_px, ()), because)
            return
        now = belief.value if corrected is None else corrected.hypothesis
        anchors = () if old is None else old.value.anchors
        near = self._near(anchors, now)
        kept = tuple(
            f.track for f in followed if f.expected and f.track.misses < MISSES and f.track.template_frame in near)
        taken = 0 if old is None else old.value.taken
        renewed = self._renewed(view, kept, anchors, frame, image, now, taken)
        tracks = self._kept(old, renewed.tracks, because)
        yield tracks
        if corrected is not None or renewed.hypothesis is not now:
            correction = Revise(belief, renewed.hypothesis, (frame, belief, tracks))
            yield correction
            yield from self._learnt(view, renewed.hypothesis, correction)
        if corrected is not None:
            shift = median(math.dist(t.predicted_px, t.found_px) for t in seen if t.found_px is not None)
            what = f"{len(seen)} landmarks are {shift:.1f} px from where they were expected"
            yield from self._told(view, what, shift, belief.value, seen, (correction,))

    def _begun_anew(
        self, view: View, frame: Entry[Frame], belief: Entry[Hypothesis], old: Entry[Tracks] | None
    ) -> Iterable[Effect]:
        """A milestone or a relocalization said anew where we are: landmarks are taken from there."""
        fresh = self._renewed(view, (), (), frame, self._picture(frame.value.jpeg), belief.value, 0)
        tracks = self._kept(old, fresh.tracks, (frame, belief))
        yield tracks
        drift = view.latest(Drift)
        if drift is not None:
            heading = fresh.hypothesis.world_from_robot(self._robot.world).heading_rad
            yield Revise(drift, drift.value.restart(heading), (tracks,))
        if fresh.hypothesis is not belief.value:
            yield Revise(belief, fresh.hypothesis, (frame, belief, tracks))

    def _learnt(self, view: View, belief: Hypothesis, correction: Revise) -> Iterable[Effect]:
        """How the wheels drift, when the robot has gone far enough to tell."""
        drift = view.latest(Drift)
        if drift is None or drift.value.gone_m < STRETCH_M:
            return
        heading = belief.world_from_robot(self._robot.world).heading_rad
        told = drift.value.update(self._robot.actuator, heading, math.sqrt(2.0) * belief.sigma_rad)
        yield Revise(drift, told, (drift, correction))

    def _followed(self, view: View, tracks: Tracks | None, image: Image, belief: Hypothesis) -> list[TrackUpdate]:
        if tracks is None:
            return []
        world = self._robot.world
        return follow_landmarks(standing_in(view, self._robot, belief.locale), tracks.items,
                      lambda track: self._template(view[track.template_frame].value.jpeg, track.template_px), image,
                      belief.world_from_robot(world), belief.covariance_world(world))

    def _cut(self, jpeg: bytes, at_px: tuple[float, float]) -> Template:
        """The template round a pixel of a picture; the last ones are remembered, as they serve for many frames."""
        return extract_template(self._picture(jpeg), at_px, DEFAULT.tracking.template_half_px)

    def _corrected(self, belief: Hypothesis, seen: list[Track], anchors: tuple[Anchor, ...]) -> Corrected:
        """The belief after the landmarks were found."""
        world = self._robot.world
        pose, covariance, agreeing = correct_pose(
            self._robot.on_floor_of(belief.locale), seen, anchors, belief.world_from_robot(world),
            belief.covariance_world(world),
        )
        hypothesis = Hypothesis.of_world(world, belief.locale, pose, covariance, "tracks", motion=belief.motion)
        return Corrected(hypothesis, agreeing)

    def _renewed(
        self, view: View, kept: tuple[Track, ...], anchors: tuple[Anchor, ...], frame: Entry[Frame], image: Image,
        belief: Hypothesis, taken: int,
    ) -> Renewed:
        """New landmarks as old ones leave, cut where the model's edges say that they are."""
        world = self._robot.world
        if len(kept) >= max(FEWEST, min(FEW, LEFT_PART * taken)):
            return Renewed(self._anchored(kept, anchors, frame, belief, taken), belief)
        robot, pose = standing_in(view, self._robot, belief.locale), belief.world_from_robot(world)
        lines = visible_lines(
            world, robot.camera, robot.camera_from_world(pose), min_length_px=LENGTH_PX, min_contrast=CONTRAST,
            max_distance_m=15.0,
        )
        found = align_to_edges(robot, image, lines.lines_world, pose, belief.covariance_world(world))
        if found is not None:
            pose = found.world_from_robot
            belief = Hypothesis.of_world(world, belief.locale, pose, found.covariance, "tracks", motion=belief.motion)
        items = (*kept, *select_landmarks(robot, kept, frame.id, image, pose))
        return Renewed(self._anchored(items, anchors, frame, belief, len(items)), belief)

    def _near(self, anchors: tuple[Anchor, ...], belief: Hypothesis) -> frozenset[str]:
        """The frames that were taken near enough to here for their templates to serve on."""
        here = belief.world_from_robot(self._robot.world)
        far_m = FAR_ON_THE_MOVE_M if self._robot.continuous else FAR_M
        return frozenset(a.frame for a in anchors if math.hypot(a.x_m - here.x_m, a.y_m - here.y_m) <= far_m)

    def _anchored(
        self, items: tuple[Track, ...], anchors: tuple[Anchor, ...], frame: Entry[Frame], belief: Hypothesis,
        taken: int,
    ) -> Tracks:
        """The tracks, with what was believed where their templates were cut."""
        pose = belief.world_from_robot(self._robot.world)
        here = Anchor(frame.id, pose.x_m, pose.y_m, covariance_tuple(belief.covariance_world(self._robot.world)))
        used = {t.template_frame for t in items}
        half_px = DEFAULT.tracking.template_half_px
        return Tracks(frame.id, half_px, items, tuple(a for a in (*anchors, here) if a.frame in used), taken)

    def _told(
        self, view: View, what: str, magnitude_px: float, belief: Hypothesis, tracks: list[Track],
        because: tuple[object, ...],
    ) -> Iterable[Effect]:
        points = np.array([track.point_world for track in tracks])
        bounds = (action_px(self._robot, belief, points), PLAN_PX)
        found = Discrepancy(Level.ACTION, what, magnitude_px, bounds, "px")
        last = open_discrepancy(view, Level.ACTION)
        if last is None or not last.value.exceeds:  # what is beyond its bound already is not for landmarks to close
            yield Post(found, because) if last is None else Revise(last, found, because)

    @staticmethod
    def _kept(old: Entry[Tracks] | None, tracks: Tracks, because: tuple[object, ...]) -> Effect:
        return Post(tracks, because) if old is None else Revise(old, tracks, because)


def _furthest(seen: list[Track]) -> str:
    """The landmark that is furthest from where it was expected, in words."""
    off = [(math.dist(t.predicted_px, t.found_px), t.landmark) for t in seen if t.found_px is not None]
    return f" ({max(off)[1]} is {max(off)[0]:.1f} px off)" if off else " (none of them is found)"
