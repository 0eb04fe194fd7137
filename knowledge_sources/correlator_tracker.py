"""Correlator tracker (§5): landmarks are followed by template correlation, and correct the belief while moving.

Before each increment the motion of each landmark in the image is predicted; the difference between the prediction and
the place where its template correlates best tells how the motion deviated (Figure 10). New landmarks are taken as old
ones leave the view.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from blackboard.board import View
from blackboard.change import Change, Posted, Revised, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.entry import Entry
from blackboard.knowledge_source import KnowledgeSource
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from knowledge_sources.methods.correlation import (
    Template,
    corner_strength,
    correlate,
    extract_template,
    fits,
    self_correlation,
)
from knowledge_sources.methods.images import decode
from knowledge_sources.methods.pose.planar import point_jacobian
from knowledge_sources.methods.pose.planar_from_points import planar_from_points
from knowledge_sources.questions import held, open_discrepancy
from knowledge_sources.tolerances import PLAN_PX, action_px
from world_models.body import Frame
from world_models.camera import NEAR_M
from world_models.frames import Pose2
from world_models.location import Hypothesis, covariance_tuple
from world_models.percepts import Anchor, Track, Tracks
from world_models.robot import RobotModel
from world_models.visibility import visible_points

HALF_PX = 10
TRACKS = 14
"""How many landmarks are followed."""
FEW = 9
"""With fewer than this, new ones are taken."""
SPACING_PX = 28.0
LEAST_PEAK = 0.7
LEAST_MARGIN = 0.08
"""How much better than the second best place in its window a landmark must correlate: is the peak unique?"""
LEAST_CORNER = 3.0
SEARCH_PX = (6.0, 48.0)
MISSES = 2
"""A landmark that is not found so often in a row is given up."""
LEAST = 4
"""Fewer expected landmarks than this do not make a discrepancy."""
LOST_PART = 1.0 / 3.0
"""When fewer than this part of the expected landmarks agree, tracking cannot explain what it sees."""
UNIQUE = 0.8
"""A landmark's patch must not look more like another place nearby than this (correlation)."""
UNIQUE_PX = 14.0
SIGMAS = 4.0


class Found(NamedTuple):
    """One track in the newest frame, and whether it should have been seen there."""

    track: Track
    expected: bool


class Corrected(NamedTuple):
    """The belief after tracking, and how many landmarks agree with it."""

    hypothesis: Hypothesis
    agreeing: int


class CorrelatorTracker(KnowledgeSource):
    """Follows landmarks from frame to frame; revises the held hypothesis; posts what it had to correct."""

    level = Level.ACTION
    closes = Level.ACTION
    watches = (
        Watch(Frame, (Posted,), lambda f: f.purpose == "track"),
        Watch(Hypothesis, (Revised,), lambda h: h.is_held and h.basis in ("milestone", "relocalization")),
    )
    writes = (Tracks, Hypothesis, Discrepancy)

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot

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
        image = decode(frame.value.jpeg)
        followed = [] if old is None else self._followed(view, old.value.items, image, belief.value)
        seen = [f.track for f in followed if f.track.found_px is not None]
        expected = sum(1 for f in followed if f.expected)
        because = (frame, belief) if old is None else (frame, belief, old)
        corrected = self._corrected(belief.value, seen, old.value.anchors) if seen and old is not None else None
        agreeing = 0 if corrected is None else corrected.agreeing
        if expected >= LEAST and agreeing < LOST_PART * expected:
            what = f"{expected - agreeing} of {expected} landmarks are not where they were expected"
            yield from self._told(view, what, math.inf, belief.value, because)
            yield from self._kept(old, Tracks(frame.id, HALF_PX, ()), because)
            return
        now = belief.value
        if corrected is not None:
            now = corrected.hypothesis
            correction = Revise(belief, now, because)
            yield correction
            shift = float(np.median([math.dist(t.predicted_px, t.found_px) for t in seen if t.found_px is not None]))
            what = f"{len(seen)} landmarks are {shift:.1f} px from where they were expected"
            yield from self._told(view, what, shift, belief.value, (correction,))
        kept = tuple(f.track for f in followed if f.expected and f.track.misses < MISSES)
        yield from self._kept(old, self._renewed(kept, old.value.anchors if old else (), frame, image, now), because)

    def _begun_anew(
        self, frame: Entry[Frame], belief: Entry[Hypothesis], old: Entry[Tracks] | None
    ) -> Iterable[Effect]:
        """A milestone or a relocalization said anew where we are: landmarks are taken from there."""
        fresh = self._renewed((), (), frame, decode(frame.value.jpeg), belief.value)
        yield from self._kept(old, fresh, (frame, belief))

    def _followed(
        self, view: View, tracks: tuple[Track, ...], image: NDArray[np.uint8], belief: Hypothesis
    ) -> list[Found]:
        if not tracks:
            return []
        pose = belief.world_from_robot(self._robot.world)
        points = np.array([t.point_world for t in tracks])
        depth, predicted, spread = self._predicted(points, pose, belief.covariance_world(self._robot.world))
        pictures = {name: decode(view[name].value.jpeg) for name in sorted({t.template_frame for t in tracks})}
        out = []
        for t, z, at, sigma in zip(tracks, depth, predicted, spread, strict=True):
            ahead = z > NEAR_M and fits(image.shape, at, HALF_PX + 2)
            t = replace(t, predicted_px=(float(at[0]), float(at[1])), found_px=None)
            scale = t.template_depth_m / max(float(z), NEAR_M)
            if not ahead or not 0.55 <= scale <= 1.8:
                out.append(Found(t, False))
                continue
            template = extract_template(pictures[t.template_frame], t.template_px, HALF_PX)
            out.append(Found(_correlated(t, template, image, float(sigma), scale), True))
        return out

    def _predicted(
        self, points: NDArray[np.float64], pose: Pose2, covariance: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Depths (n,), pixels (n, 2) and the standard deviation (n,) of the pixels [px]."""
        camera = self._robot.camera
        state = np.array([pose.x_m, pose.y_m, pose.heading_rad])
        p, _, jacobian = point_jacobian(
            points, np.array([camera.fx, camera.fy]), state, self._robot.mount.camera_from_robot
        )
        ahead = np.where(p[:, 2:] > NEAR_M, p, [0.0, 0.0, 1.0])
        spread = np.einsum("nij,jk,nik->ni", jacobian, covariance, jacobian)
        return p[:, 2], camera.project(ahead), np.sqrt(np.max(spread, axis=1))

    def _corrected(self, belief: Hypothesis, seen: list[Track], anchors: tuple[Anchor, ...]) -> Corrected:
        """The belief after the landmarks were found."""
        world = self._robot.world
        estimate = planar_from_points(
            np.array([t.point_world for t in seen]),
            np.array([t.found_px for t in seen]),
            self._robot.camera,
            self._robot.mount.camera_from_robot,
            belief.world_from_robot(world),
            belief.covariance_world(world),
            sigma_px=np.array([t.sigma_px for t in seen]),
        )
        pose = estimate.world_from_robot
        covariance = estimate.covariance + _inherited(pose, seen, anchors)
        hypothesis = Hypothesis.of_world(world, belief.locale, pose, covariance, "tracks", motion=belief.motion)
        return Corrected(hypothesis, int(np.count_nonzero(estimate.inliers)))

    def _renewed(
        self, kept: tuple[Track, ...], anchors: tuple[Anchor, ...], frame: Entry[Frame], image: NDArray[np.uint8],
        belief: Hypothesis,
    ) -> Tracks:
        """New landmarks as old ones leave: visible in the model, and a corner in the image."""
        pose = belief.world_from_robot(self._robot.world)
        new = self._chosen(kept, frame.id, image, pose) if len(kept) < FEW else ()
        items = (*kept, *new)
        here = Anchor(frame.id, pose.x_m, pose.y_m, covariance_tuple(belief.covariance_world(self._robot.world)))
        used = {t.template_frame for t in items}
        return Tracks(frame.id, HALF_PX, items, tuple(a for a in (*anchors, here) if a.frame in used))

    def _chosen(
        self, kept: tuple[Track, ...], frame: str, image: NDArray[np.uint8], pose: Pose2
    ) -> tuple[Track, ...]:
        """Corners of the model that are visible, and distinctive in the image; well apart from each other."""
        robot = self._robot
        camera_from_world = robot.camera_from_world(pose)
        points = visible_points(
            robot.world, robot.camera, camera_from_world, margin_px=HALF_PX + 4.0, min_contrast=0.08,
            max_distance_m=15.0,
        )
        strength = np.array([corner_strength(image, px, HALF_PX) for px in points.points_px])
        taken = [np.array(t.found_px or t.predicted_px) for t in kept]
        new: list[Track] = []
        for i in np.argsort(-strength, kind="stable"):
            if strength[i] < LEAST_CORNER or len(taken) >= TRACKS:
                break
            px, point = points.points_px[i], points.points_world[i]
            if all(np.linalg.norm(px - other) >= SPACING_PX for other in taken) and _is_unique(image, px):
                taken.append(px)
                name = robot.world.landmarks[points.landmark[i]].name
                new.append(_begun(point, px, float(camera_from_world.apply(point)[2]), name, frame))
        return tuple(new)

    def _told(
        self, view: View, what: str, magnitude_px: float, belief: Hypothesis, because: tuple[object, ...]
    ) -> Iterable[Effect]:
        bounds = (action_px(self._robot, belief), PLAN_PX)
        found = Discrepancy(Level.ACTION, what, magnitude_px, bounds, "px")
        last = open_discrepancy(view, Level.ACTION)
        yield Post(found, because) if last is None else Revise(last, found, because)

    @staticmethod
    def _kept(
        old: Entry[Tracks] | None, tracks: Tracks, because: tuple[object, ...]
    ) -> Iterable[Effect]:
        yield Post(tracks, because) if old is None else Revise(old, tracks, because)


def _is_unique(image: NDArray[np.uint8], px: NDArray[np.float64]) -> bool:
    return bool(self_correlation(image, px, HALF_PX, UNIQUE_PX).second_peak < UNIQUE)


def _correlated(track: Track, template: Template, image: NDArray[np.uint8], sigma: float, scale: float) -> Track:
    search = min(max(SIGMAS * sigma + 2.0, SEARCH_PX[0]), SEARCH_PX[1])
    found = correlate(template, image, np.array(track.predicted_px), search, scale=scale)
    if found is None or found.peak < LEAST_PEAK or found.at_border or found.peak - found.second_peak < LEAST_MARGIN:
        return replace(track, misses=track.misses + 1, peak=-1.0 if found is None else found.peak)
    at = (float(found.position_px[0]), float(found.position_px[1]))
    return replace(track, found_px=at, peak=float(found.peak), sigma_px=max(0.3, float(found.sigma_px)), misses=0)


def _begun(point: NDArray[np.float64], px: NDArray[np.float64], depth_m: float, landmark: str, frame: str) -> Track:
    x, y, z = (float(c) for c in point)
    at = (float(px[0]), float(px[1]))
    return Track(landmark, (x, y, z), frame, at, float(depth_m), at, at, 1.0, 0.3)


def _inherited(pose: Pose2, seen: list[Track], anchors: tuple[Anchor, ...]) -> NDArray[np.float64]:
    """(3, 3) mean covariance of the beliefs from which the templates were cut, carried over to here."""
    share = {a.frame: a for a in anchors}
    parts = []
    for track in seen:
        anchor = share[track.template_frame]
        lever = np.eye(3)
        lever[0, 2], lever[1, 2] = -(pose.y_m - anchor.y_m), pose.x_m - anchor.x_m
        parts.append(lever @ np.array(anchor.covariance) @ lever.T)
    return np.asarray(np.mean(parts, axis=0))
