"""Correlator tracker (§5): landmarks are followed by template correlation, and correct the belief while moving.

Before each increment the motion of each landmark in the image is predicted; the difference between the prediction and
the place where its template correlates best tells how the motion deviated (Figure 10). New landmarks are taken as old
ones leave the view.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from blackboard.board import View
from blackboard.change import Change, Posted, Revised, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.entry import Entry
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from knowledge_sources.expert import Expert
from knowledge_sources.methods.rectified import Rectified
from knowledge_sources.methods.tracking import HALF_PX, Followed, Image, begin, correct, follow
from knowledge_sources.questions import held, open_discrepancy
from knowledge_sources.tolerances import PLAN_PX, action_px
from world_models.body import Frame
from world_models.location import Hypothesis, covariance_tuple
from world_models.percepts import Anchor, Track, Tracks
from world_models.robot import RobotModel

FEW = 9
"""With fewer landmarks than this, new ones are taken."""
MISSES = 2
"""A landmark that is not found so often in a row is given up."""
LEAST = 4
"""Fewer expected landmarks than this do not make a discrepancy."""
LOST_PART = 1.0 / 3.0
"""When fewer than this part of the expected landmarks agree, tracking cannot explain what it sees."""


class Corrected(NamedTuple):
    """The belief after tracking, and how many landmarks agree with it."""

    hypothesis: Hypothesis
    agreeing: int


class CorrelatorTracker(Expert):
    """Follows landmarks from frame to frame; revises the held hypothesis; posts what it had to correct."""

    level = Level.ACTION
    closes = Level.ACTION
    watches = (
        Watch(Frame, (Posted,), lambda f: f.purpose == "track"),
        Watch(Hypothesis, (Revised,), lambda h: h.is_held and h.basis in ("milestone", "relocalization")),
    )
    writes = (Tracks, Hypothesis, Discrepancy)

    def __init__(self, robot: RobotModel) -> None:
        super().__init__(robot)
        self._picture = Rectified(robot.lens, robot.camera)

    def rate(self, view: View, trigger: Change) -> float | None:
        if held(view) is None or view.latest(Frame) is None or open_discrepancy(view, Level.GOAL) is not None:
            return None
        return 0.9

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        frame, belief, old = view.latest(Frame), held(view), view.latest(Tracks)
        if belief is None or frame is None:
            return
        if isinstance(trigger.entry.value, Hypothesis):
            yield from self._begun_anew(frame, belief, old)
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
            yield from self._told(view, what, math.inf, belief.value, because)
            yield self._kept(old, Tracks(frame.id, HALF_PX, ()), because)
            return
        now = belief.value if corrected is None else corrected.hypothesis
        kept = tuple(f.track for f in followed if f.expected and f.track.misses < MISSES)
        renewed = self._renewed(kept, old.value.anchors if old else (), frame, image, now)
        tracks = self._kept(old, renewed, because)
        yield tracks
        if corrected is not None:
            correction = Revise(belief, now, (frame, belief, tracks))
            yield correction
            shift = float(np.median([math.dist(t.predicted_px, t.found_px) for t in seen if t.found_px is not None]))
            what = f"{len(seen)} landmarks are {shift:.1f} px from where they were expected"
            yield from self._told(view, what, shift, belief.value, (correction,))

    def _begun_anew(
        self, frame: Entry[Frame], belief: Entry[Hypothesis], old: Entry[Tracks] | None
    ) -> Iterable[Effect]:
        """A milestone or a relocalization said anew where we are: landmarks are taken from there."""
        fresh = self._renewed((), (), frame, self._picture(frame.value.jpeg), belief.value)
        yield self._kept(old, fresh, (frame, belief))

    def _followed(self, view: View, tracks: Tracks | None, image: Image, belief: Hypothesis) -> list[Followed]:
        if tracks is None:
            return []
        frames = sorted({t.template_frame for t in tracks.items})
        pictures = {name: self._picture(view[name].value.jpeg) for name in frames}
        world = self._robot.world
        return follow(self._robot, tracks.items, pictures, image, belief.world_from_robot(world),
                      belief.covariance_world(world))

    def _corrected(self, belief: Hypothesis, seen: list[Track], anchors: tuple[Anchor, ...]) -> Corrected:
        """The belief after the landmarks were found."""
        world = self._robot.world
        pose, covariance, agreeing = correct(
            self._robot, seen, anchors, belief.world_from_robot(world), belief.covariance_world(world)
        )
        hypothesis = Hypothesis.of_world(world, belief.locale, pose, covariance, "tracks", motion=belief.motion)
        return Corrected(hypothesis, agreeing)

    def _renewed(
        self, kept: tuple[Track, ...], anchors: tuple[Anchor, ...], frame: Entry[Frame], image: Image,
        belief: Hypothesis,
    ) -> Tracks:
        """New landmarks as old ones leave."""
        pose = belief.world_from_robot(self._robot.world)
        items = (*kept, *begin(self._robot, kept, frame.id, image, pose)) if len(kept) < FEW else kept
        here = Anchor(frame.id, pose.x_m, pose.y_m, covariance_tuple(belief.covariance_world(self._robot.world)))
        used = {t.template_frame for t in items}
        return Tracks(frame.id, HALF_PX, items, tuple(a for a in (*anchors, here) if a.frame in used))

    def _told(
        self, view: View, what: str, magnitude_px: float, belief: Hypothesis, because: tuple[object, ...]
    ) -> Iterable[Effect]:
        bounds = (action_px(self._robot, belief), PLAN_PX)
        found = Discrepancy(Level.ACTION, what, magnitude_px, bounds, "px")
        last = open_discrepancy(view, Level.ACTION)
        yield Post(found, because) if last is None else Revise(last, found, because)

    @staticmethod
    def _kept(old: Entry[Tracks] | None, tracks: Tracks, because: tuple[object, ...]) -> Effect:
        return Post(tracks, because) if old is None else Revise(old, tracks, because)


def _furthest(seen: list[Track]) -> str:
    """The landmark that is furthest from where it was expected, in words."""
    off = [(math.dist(t.predicted_px, t.found_px), t.landmark) for t in seen if t.found_px is not None]
    return f" ({max(off)[1]} is {max(off)[0]:.1f} px off)" if off else " (none of them is found)"
