"""What stays in place in the picture while the robot turns is before its camera, not in the building (§4)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.sparse.csgraph import connected_components

from knowledge_sources.methods.arrays import Floats, Ints, Mask
from knowledge_sources.methods.localization.views import CameraView
from knowledge_sources.settings import DEFAULT
from knowledge_sources.settings.localization import LocalizationSettings
from world_models.camera import Camera
from world_models.entries.obstruction import Obstruction
from world_models.frames import wrap_angle


def update_obstruction(
    views: Sequence[CameraView], camera: Camera, known: Obstruction | None, min_area: float | None = None,
    settings: LocalizationSettings = DEFAULT.localization,
) -> Obstruction | None:
    """Find what is before the camera in these views; else return what was known, unless something is seen inside it.

    ``min_area`` is the smallest part of the picture, by default ``settings.min_obstruction_area``.
    """
    found = find_obstruction(views, camera, min_area, settings)
    if found is None and known is not None and is_opaque(known, [v.segments_px for v in views], settings):
        return known
    return found


def find_obstruction(
    views: Sequence[CameraView], camera: Camera, min_area: float | None = None,
    settings: LocalizationSettings = DEFAULT.localization,
) -> Obstruction | None:
    """Find what hides the same part of all views; None if nothing does, or too few directions were looked in.

    Stationary segments are those with counterparts in views of other directions. The outline is their convex hull. If
    it is not opaque, since other segments lie within, one side after the other is left out as chance; then the number
    of counterparts that is asked for grows.
    """
    if min_area is None:
        min_area = settings.min_obstruction_area
    counts = [_count_counterparts(views, k, settings) for k in range(len(views))]
    for least in range(settings.min_stationary_views, len(views)):
        stationary = [count >= max(least, settings.min_stationary_fraction * total) for count, total in counts]
        sides = _build_sides([v.segments_px[some] for v, some in zip(views, stationary, strict=True)], settings)
        others = [v.segments_px[~some] for v, some in zip(views, stationary, strict=True)]
        for _ in range(1 + settings.max_dropped_sides):
            obstruction = _enclose(sides, camera, min_area, settings)
            if obstruction is not None and is_opaque(obstruction, others, settings):
                return obstruction
            if len(sides) <= settings.min_sides:
                break
            sides, others = _drop_worst_side(sides, others, camera, settings)
    return None


def is_opaque(
    obstruction: Obstruction, segments_px: Sequence[Floats], settings: LocalizationSettings = DEFAULT.localization
) -> bool:
    """Whether hardly any of the segments (n, 2, 2) of several views lie inside an outline."""
    return _measure_inside(obstruction, segments_px, settings) <= settings.max_inside_fraction


def has_counterpart(one_px: Floats, other_px: Floats, settings: LocalizationSettings = DEFAULT.localization) -> Mask:
    """Return which segments (n, 2, 2) lie on, and beside, one of others (m, 2, 2)."""
    return np.asarray(np.any(_lie_on(one_px, other_px, settings), axis=1))


def _count_counterparts(views: Sequence[CameraView], which: int, settings: LocalizationSettings) -> tuple[Ints, int]:
    """(n,) in how many views of other directions each segment of a view has a counterpart, and how many those are."""
    one = views[which]
    others = [v for v in views if abs(wrap_angle(v.now_from_then.heading_rad - one.now_from_then.heading_rad))
              > settings.min_turn_between_views_rad]
    found = [has_counterpart(one.segments_px, other.segments_px, settings) for other in others]
    return np.sum([np.zeros(len(one.segments_px), np.int64), *found], axis=0), len(others)


def _measure_inside(
    obstruction: Obstruction, segments_px: Sequence[Floats], settings: LocalizationSettings
) -> float:
    """Length of segments inside an outline, as a part of the outline's own length in all views."""
    inside = math.fsum(float(np.sum(_measure(s) * obstruction.hidden_part(s, -settings.inside_margin_px)))
                       for s in segments_px)
    corners = np.array(obstruction.outline_px)
    perimeter = float(np.sum(np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)))
    return inside / (len(segments_px) * perimeter)


@dataclass(frozen=True, slots=True, eq=False)
class _Side:
    """One stationary line: (2, 2) its ends [px], and (n, 2, 2) the segments that show it."""

    ends_px: Floats
    segments_px: Floats


def _build_sides(stationary: Sequence[Floats], settings: LocalizationSettings) -> list[_Side]:
    """Group the stationary segments (n, 2, 2) of all views: those that lie on each other are one side.

    In some views a side continues in an edge of the building, or is seen in part only.
    """
    segments = np.concatenate([np.zeros((0, 2, 2)), *stationary])
    if not len(segments):
        return []
    count, which = connected_components(_lie_on(segments, segments, settings), directed=False)
    groups = [segments[which == k] for k in range(count)]
    return [_Side(_find_ends(group, settings.side_end_quantile), group) for group in groups]


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


def _enclose(
    sides: Sequence[_Side], camera: Camera, min_area: float, settings: LocalizationSettings
) -> Obstruction | None:
    """The convex hull of sides; None where its part of the picture is too small or too large."""
    corners = np.array([side.ends_px for side in sides]).reshape(-1, 2)
    if len(corners) < 3:
        return None
    hull = cv2.approxPolyDP(cv2.convexHull(corners.astype(np.float32)), settings.stationary_px, True)
    corners = np.round(np.asarray(hull, float).reshape(-1, 2))
    if len(corners) < 3:
        return None
    area = abs(float(cv2.contourArea(corners.astype(np.float32)))) / (camera.width * camera.height)
    if not min_area <= area <= settings.max_obstruction_area:
        return None
    return Obstruction(tuple((float(x), float(y)) for x, y in corners))


def _drop_worst_side(
    sides: list[_Side], others: list[Floats], camera: Camera, settings: LocalizationSettings
) -> tuple[list[_Side], list[Floats]]:
    """Leave out the side without which least lies inside the outline; its segments are then of the building."""
    rated: list[tuple[float, int, list[Floats]]] = []
    for k, side in enumerate(sides):
        outline = _enclose([*sides[:k], *sides[k + 1 :]], camera, 0.0, settings)
        seen = [np.concatenate([others[0], side.segments_px]), *others[1:]]
        rated.append((math.inf if outline is None else _measure_inside(outline, seen, settings), k, seen))
    _, worst, seen = min(rated, key=lambda one: one[:2])
    return [*sides[:worst], *sides[worst + 1 :]], seen


def _lie_on(one_px: Floats, other_px: Floats, settings: LocalizationSettings) -> Mask:
    """(n, m) which segments (n, 2, 2) lie on, and beside, which of others (m, 2, 2)."""
    if not len(one_px) or not len(other_px):
        return np.zeros((len(one_px), len(other_px)), bool)
    length, size = _measure(one_px), _measure(other_px)
    along = (one_px[:, 1] - one_px[:, 0]) / length[:, None]
    direction = (other_px[:, 1] - other_px[:, 0]) / size[:, None]
    turned = np.abs(along[:, None, 0] * direction[None, :, 1] - along[:, None, 1] * direction[None, :, 0])
    away = other_px[None] - one_px[:, None, None, 0]  # (n, m, 2, 2)
    across = np.abs(away[..., 0] * along[:, None, None, 1] - away[..., 1] * along[:, None, None, 0]).max(axis=2)
    at = away[..., 0] * along[:, None, None, 0] + away[..., 1] * along[:, None, None, 1]
    shared = np.minimum(at.max(axis=2), length[:, None]) - np.maximum(at.min(axis=2), 0.0)
    beside = shared >= settings.min_stationary_overlap * np.minimum(length[:, None], size[None])
    return np.asarray((turned <= settings.stationary_rad) & (across <= settings.stationary_px) & beside)


def _measure(segments_px: Floats) -> Floats:
    """(n,) lengths, none of them zero."""
    return np.asarray(np.maximum(np.linalg.norm(segments_px[:, 1] - segments_px[:, 0], axis=1), 1e-9))
