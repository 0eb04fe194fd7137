"""Views that were taken while the pose was unknown, and the occlusions of the lens in them.

Views are related by the motions between them; level lines correct the turns. What stays in place in the picture while
the robot turns is before its camera, not in the building (§4).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from knowledge_sources.methods.arrays import Floats, Ints, Mask
from knowledge_sources.methods.features import RIGHT_ANGLE_RAD, find_level_direction
from world_models.camera import Camera
from world_models.compiled import compiled
from world_models.entries import Obstruction
from world_models.frames import Pose, Pose2, wrap_angle

LEVEL_HEADING_SIGMA_RAD = math.radians(0.3)  # standard deviation of a turn measured by level lines
MAX_HEADING_CORRECTION_RAD = math.radians(20.0)
"""Largest correction of a turn by level lines; odometry decides between the four."""
MAX_HEADING_SIGMAS = 5.0  # the same in standard deviations of the turn
MIN_TURN_BETWEEN_VIEWS_RAD = math.radians(10.0)
"""Turn from which nothing of the building stays where it is in the picture."""
STATIONARY_PX = 1.5  # distance of two segments that are one stationary line
STATIONARY_RAD = 0.03  # angle of two segments that are one stationary line
MIN_STATIONARY_OVERLAP = 0.5  # part of the shorter of two segments that must lie beside the other
MIN_STATIONARY_VIEWS = 2  # other views in which a stationary segment has a counterpart: in one it may be by chance
MIN_STATIONARY_FRACTION = 0.6  # part of the other views in which a stationary segment has a counterpart
MIN_OBSTRUCTION_AREA = 0.01  # smallest obstruction, as a part of the picture
MAX_OBSTRUCTION_AREA = 0.5
"""Largest obstruction, as a part of the picture: where more is stationary, the robot did not turn."""
SIDE_END_QUANTILE = 0.8  # quantile of segment ends that is the end of a side: longer ones go on in something else
MIN_SIDES = 3  # fewest sides of an outline
MAX_DROPPED_SIDES = 4  # most sides that are left out as chance
MAX_COMPARED_VIEWS = 8  # most views, the last, that are compared
MAX_COMPARED_SEGMENTS = 300  # most segments of a view, the longest, that may be sides: bricks and tiles have many more
MAX_SIDES = 12  # most sides of an outline that are tried, those that are seen at the greatest length
INSIDE_MARGIN_PX = 8.0  # distance within the outline from which a segment lies inside
MAX_INSIDE_FRACTION = 0.1  # largest length of segments inside an opaque outline, as a part of the outline's own
MIN_GROWTH = 1.05  # least part of an outline that is found by which one with what was known is larger, to be kept
MAX_TRIED_FRACTION = 5.0  # where more lies inside, as of a texture, no single side is left out as chance


@dataclass(frozen=True, slots=True, eq=False)
class CameraView:
    """The line segments of one picture, and where the robot was when it was taken.

    Attributes:
        segments_px: (n, 2, 2) found in the picture.
        now_from_then: the robot's pose then, in its frame now.
        covariance: (3, 3) of ``now_from_then`` over (x, y, heading).
    """

    segments_px: Floats
    now_from_then: Pose2
    covariance: Floats

    def pose_then(self, world_from_now: Pose2) -> Pose2:
        """The robot's pose when the picture was taken, if it is at ``world_from_now`` now."""
        return world_from_now @ self.now_from_then


def propagate_pose(now_from_then: Pose2, covariance: Floats, step: Pose2, step_covariance: Floats
                   ) -> tuple[Pose2, Floats]:
    """Express an earlier pose in the robot's frame after one more step, with its covariance (3, 3)."""
    after = step.inverse() @ now_from_then
    c, s = math.cos(step.heading_rad), math.sin(step.heading_rad)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    lever = np.eye(3)
    lever[0, 2], lever[1, 2] = -after.y_m, after.x_m  # an error in the step's heading moves the earlier position
    return after, np.asarray(turn @ covariance @ turn.T + lever @ turn @ step_covariance @ turn.T @ lever.T)


def join_covariances(views: Sequence[CameraView]) -> Floats:
    """Join the covariances of all views' motions, (3n, 3n) over (x, y, heading) of each, in the robot's frame now.

    Views share what was driven after the later one of them: an error of it moves both. Where a view's covariance is
    smaller than that (its turn was measured), the least is added that makes the whole a covariance.
    """
    size, joint = len(views), np.zeros((3 * len(views), 3 * len(views)))
    for k, later in enumerate(views):
        joint[3 * k:3 * k + 3, 3 * k:3 * k + 3] = later.covariance
        for i in range(k):
            shared = find_lever(later.now_from_then, views[i].now_from_then) @ later.covariance
            joint[3 * i:3 * i + 3, 3 * k:3 * k + 3], joint[3 * k:3 * k + 3, 3 * i:3 * i + 3] = shared, shared.T
    values, axes = np.linalg.eigh(joint) if size else (np.zeros(0), joint)
    return np.asarray(axes * np.maximum(values, 0.0) @ axes.T)


def find_lever(here: Pose2, there: Pose2) -> Floats:
    """Jacobian (3, 3) of a pose by one that it is fixed to: an error of that one's heading moves it aside."""
    lever = np.eye(3)
    lever[0, 2], lever[1, 2] = here.y_m - there.y_m, there.x_m - here.x_m
    return lever


def align_headings(
    views: Sequence[CameraView], camera: Camera, camera_from_robot: Pose
) -> tuple[CameraView, ...]:
    """Correct the turns between views, in the order in which they were taken, by the level lines they show.

    Odometry errs by a fortieth of a turn. Level lines run in two directions at right angles (Manhattan world), which
    are seen to a tenth of a degree; odometry tells which of the four directions is which. The last view is from where
    the robot is now. If it shows no level lines, the reference is the last view that does, and all turns are known no
    better than that view's.
    """
    axes = _find_axes(views, camera, camera_from_robot)
    if len(axes) < 2:
        return tuple(views)
    reference = max(axes)
    axis = axes[reference]
    variance = float(views[reference].covariance[2, 2]) + LEVEL_HEADING_SIGMA_RAD**2
    out, off_later = [views[-1]], 0.0
    for k in range(len(views) - 2, -1, -1):
        view, off = views[k], math.remainder(axis - axes[k], RIGHT_ANGLE_RAD) if k in axes else math.inf
        if abs(off) < _bound_correction(view.covariance) and k != reference:
            view = replace(view, covariance=_limit_turn_variance(view.covariance, variance))
        else:
            off = off_later
        pose = _correct_turn(view, views[k + 1], out[-1].now_from_then, off_later - off)
        out.append(replace(view, now_from_then=pose))
        off_later = off
    return tuple(reversed(out))


def _find_axes(
    views: Sequence[CameraView], camera: Camera, camera_from_robot: Pose
) -> dict[int, float]:
    """By index of the views that show level lines: their direction in the frame of now, modulo a right angle [rad]."""
    found = [find_level_direction(v.segments_px, camera, camera_from_robot) for v in views]
    return {k: direction + view.now_from_then.heading_rad
            for k, (view, direction) in enumerate(zip(views, found, strict=True)) if direction is not None}


def _bound_correction(covariance: Floats) -> float:
    """By how much level lines may correct a turn [rad]: beyond what the wheels can do they are another direction."""
    sigma_rad = math.sqrt(float(covariance[2, 2]) + LEVEL_HEADING_SIGMA_RAD**2)
    return min(MAX_HEADING_CORRECTION_RAD, MAX_HEADING_SIGMAS * sigma_rad)


def _correct_turn(view: CameraView, later: CameraView, now_from_later: Pose2, more_rad: float) -> Pose2:
    """The pose of a view if the robot turned by so much more before it moved on to the later one."""
    step = Pose2(0.0, 0.0, more_rad) @ view.now_from_then.inverse() @ later.now_from_then
    return now_from_later @ step.inverse()


def _limit_turn_variance(covariance: Floats, variance: float) -> Floats:
    """The covariance (3, 3) after the turn was measured with a variance: what is correlated with it is known better."""
    known = float(covariance[2, 2])
    if known <= variance:
        return covariance
    gain = covariance[:, 2] / known
    return np.asarray(covariance - np.outer(gain, gain) * (known - variance))


def update_obstruction(
    views: Sequence[CameraView], camera: Camera, known: Obstruction | None, min_area: float | None = None,
) -> Obstruction | None:
    """Find what is before the camera in these views, with what was known of it, unless something is seen inside that.

    A side is not found where what is behind it is as bright: so views that show some of the sides take back no other;
    nor do views in which something is seen inside what was found itself: they are from before it was there.
    ``min_area`` is the smallest part of the picture, by default ``MIN_OBSTRUCTION_AREA``.
    """
    found = find_obstruction(views, camera, min_area)
    if known is None:
        return found
    seen = [v.segments_px for v in views]
    if found is None:
        return known if is_opaque(known, seen) else None
    both, since = _join(known, found, camera), [s for s in seen if is_opaque(found, [s])]
    return both if since and is_opaque(both, since) else found


def find_obstruction(views: Sequence[CameraView], camera: Camera, min_area: float | None = None) -> Obstruction | None:
    """Find what hides the same part of all views; None if nothing does, or too few directions were looked in.

    Stationary segments are those with counterparts in views of other directions. The outline is their convex hull. If
    it is not opaque, since other segments lie within, one side after the other is left out as chance; then the number
    of counterparts that is asked for grows. Of many views and segments only some are compared, so that a textured room
    takes no longer than another.
    """
    if min_area is None:
        min_area = MIN_OBSTRUCTION_AREA
    views = views[-MAX_COMPARED_VIEWS:]
    counts = [_count_counterparts(views, k) for k in range(len(views))]
    for least in range(MIN_STATIONARY_VIEWS, len(views)):
        stationary = [count >= max(least, MIN_STATIONARY_FRACTION * total) for count, total in counts]
        sides = _build_sides([v.segments_px[some] for v, some in zip(views, stationary, strict=True)])
        others = [v.segments_px[~some] for v, some in zip(views, stationary, strict=True)]
        others[0] = np.concatenate([others[0], *(side.segments_px for side in sides[MAX_SIDES:])])
        sides = sides[:MAX_SIDES]
        for _ in range(1 + MAX_DROPPED_SIDES):
            obstruction = _enclose(sides, camera, min_area)
            inside = math.inf if obstruction is None else _measure_inside(obstruction, others)
            if inside <= MAX_INSIDE_FRACTION:
                return obstruction
            if len(sides) <= MIN_SIDES or MAX_TRIED_FRACTION < inside < math.inf:
                break
            sides, others = _drop_worst_side(sides, others, camera)
    return None


def is_opaque(obstruction: Obstruction, segments_px: Sequence[Floats]) -> bool:
    """Whether hardly any of the segments (n, 2, 2) of several views lie inside an outline."""
    return _measure_inside(obstruction, segments_px) <= MAX_INSIDE_FRACTION


def has_counterpart(one_px: Floats, other_px: Floats) -> Mask:
    """Return which segments (n, 2, 2) lie on, and beside, one of others (m, 2, 2)."""
    return np.asarray(np.any(_lie_on(one_px, other_px), axis=1))


def _count_counterparts(views: Sequence[CameraView], which: int) -> tuple[Ints, int]:
    """(n,) in how many views of other directions each segment of a view has a counterpart, and how many those are."""
    one = views[which]
    others = [v for v in views if abs(wrap_angle(v.now_from_then.heading_rad - one.now_from_then.heading_rad))
              > MIN_TURN_BETWEEN_VIEWS_RAD]
    longest = np.argsort(-_measure(one.segments_px), kind="stable")[:MAX_COMPARED_SEGMENTS]
    counts = np.zeros(len(one.segments_px), np.int64)
    for other in others:
        counts[longest] += has_counterpart(one.segments_px[longest], other.segments_px)
    return counts, len(others)


def _measure_inside(obstruction: Obstruction, segments_px: Sequence[Floats]) -> float:
    """Length of segments inside an outline, as a part of the outline's own length in all views."""
    inside = math.fsum(float(np.sum(_measure(s) * obstruction.hidden_part(s, -INSIDE_MARGIN_PX)))
                       for s in segments_px)
    corners = np.array(obstruction.outline_px)
    perimeter = float(np.sum(np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)))
    return inside / (len(segments_px) * perimeter)


@dataclass(frozen=True, slots=True, eq=False)
class _Side:
    """One stationary line: (2, 2) its ends [px], and (n, 2, 2) the segments that show it."""

    ends_px: Floats
    segments_px: Floats


def _build_sides(stationary: Sequence[Floats]) -> list[_Side]:
    """Group the stationary segments (n, 2, 2) of all views: those that lie on each other are one side.

    In some views a side continues in an edge of the building, or is seen in part only. The side that is seen at the
    greatest length comes first.
    """
    segments = np.concatenate([np.zeros((0, 2, 2)), *stationary])
    if not len(segments):
        return []
    from scipy.sparse.csgraph import connected_components  # loaded when first used: by missions whose view is hidden

    count, which = connected_components(_lie_on(segments, segments), directed=False)
    groups = [segments[which == k] for k in range(count)]
    groups.sort(key=lambda group: -float(np.sum(_measure(group))))
    return [_Side(_find_ends(group, SIDE_END_QUANTILE), group) for group in groups]


def _find_ends(segments_px: Floats, quantile: float) -> Floats:
    """(2, 2) the ends of segments (n, 2, 2) on one line, without those that continue in something else."""
    longest = segments_px[np.argmax(_measure(segments_px))]
    along = (longest[1] - longest[0]) / _measure(longest[None])[0]
    normal = np.array([-along[1], along[0]])
    at = np.sort((segments_px - longest[0]) @ along, axis=1)
    across = (segments_px - longest[0]) @ normal
    percent = 100.0 * quantile
    low, high = np.percentile(at[:, 0], 100.0 - percent), np.percentile(at[:, 1], percent)
    return np.asarray(longest[0] + np.outer([low, high], along) + float(np.median(across)) * normal)


def _enclose(sides: Sequence[_Side], camera: Camera, min_area: float) -> Obstruction | None:
    """The convex hull of sides; None where its part of the picture is too small or too large."""
    corners = np.array([side.ends_px for side in sides]).reshape(-1, 2)
    if len(corners) < 3:
        return None
    hull = cv2.approxPolyDP(cv2.convexHull(corners.astype(np.float32)), STATIONARY_PX, True)
    corners = np.round(np.asarray(hull, float).reshape(-1, 2))
    if len(corners) < 3:
        return None
    area = abs(float(cv2.contourArea(corners.astype(np.float32)))) / (camera.width * camera.height)
    if not min_area <= area <= MAX_OBSTRUCTION_AREA:
        return None
    return Obstruction(tuple((float(x), float(y)) for x, y in corners))


def _join(known: Obstruction, found: Obstruction, camera: Camera) -> Obstruction:
    """The hull of two outlines; what was found where that is hardly less, or the hull too large."""
    sides = [_Side(np.array([corner, corner]), np.zeros((0, 2, 2))) for o in (known, found) for corner in o.outline_px]
    both = _enclose(sides, camera, 0.0)
    if both is None or _measure_area(both) < MIN_GROWTH * _measure_area(found):
        return found
    return both


def _measure_area(obstruction: Obstruction) -> float:
    return abs(float(cv2.contourArea(np.array(obstruction.outline_px, np.float32))))


def _drop_worst_side(sides: list[_Side], others: list[Floats], camera: Camera) -> tuple[list[_Side], list[Floats]]:
    """Leave out the side without which least lies inside the outline; its segments are then of the building."""
    rated: list[tuple[float, int, list[Floats]]] = []
    for k, side in enumerate(sides):
        outline = _enclose([*sides[:k], *sides[k + 1 :]], camera, 0.0)
        seen = [np.concatenate([others[0], side.segments_px]), *others[1:]]
        rated.append((math.inf if outline is None else _measure_inside(outline, seen), k, seen))
    _, worst, seen = min(rated, key=lambda one: one[:2])
    return [*sides[:worst], *sides[worst + 1 :]], seen


def _lie_on(one_px: Floats, other_px: Floats) -> Mask:
    """(n, m) which segments (n, 2, 2) lie on, and beside, which of others (m, 2, 2)."""
    return np.asarray(_find_lying_on(
        np.array(one_px, float, order="C").reshape(-1, 2, 2), np.array(other_px, float, order="C").reshape(-1, 2, 2),
        STATIONARY_RAD, STATIONARY_PX, MIN_STATIONARY_OVERLAP))


@compiled
def _find_lying_on(one: Any, other: Any, most_rad: float, most_px: float, min_overlap: float) -> Any:
    out = np.zeros((len(one), len(other)), np.bool_)
    along = np.empty((len(other), 3))  # direction and length of each other segment
    for j in range(len(other)):
        u, v = other[j, 1, 0] - other[j, 0, 0], other[j, 1, 1] - other[j, 0, 1]
        size = max(math.hypot(u, v), 1e-9)
        along[j, 0], along[j, 1], along[j, 2] = u / size, v / size, size
    for i in range(len(one)):
        x0, y0 = one[i, 0, 0], one[i, 0, 1]
        u, v = one[i, 1, 0] - x0, one[i, 1, 1] - y0
        length = max(math.hypot(u, v), 1e-9)
        u, v = u / length, v / length
        for j in range(len(other)):
            if abs(u * along[j, 1] - v * along[j, 0]) > most_rad:
                continue
            x, y = other[j, 0, 0] - x0, other[j, 0, 1] - y0
            if abs(x * v - y * u) > most_px:
                continue
            start, x, y = x * u + y * v, other[j, 1, 0] - x0, other[j, 1, 1] - y0
            if abs(x * v - y * u) > most_px:
                continue
            end = x * u + y * v
            shared = min(max(start, end), length) - max(min(start, end), 0.0)
            out[i, j] = shared >= min_overlap * min(length, along[j, 2])
    return out


def _measure(segments_px: Floats) -> Floats:
    """(n,) lengths, none of them zero."""
    return np.asarray(np.maximum(np.linalg.norm(segments_px[:, 1] - segments_px[:, 0], axis=1), 1e-9))
