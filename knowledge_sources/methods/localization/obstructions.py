"""What stands still in the picture while the robot turns is before its camera, and not in the building (§4: a model is
incomplete, and so is a view)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from knowledge_sources.methods.localization.views import CameraView
from world_models.camera import Camera
from world_models.entries.obstruction import Obstruction
from world_models.frames import wrap_angle

Floats = NDArray[np.float64]
TURNED_RAD = math.radians(10.0)
"""Looks in directions that differ by more show nothing of the building at the same place of the picture."""
OFF_PX, OFF_RAD = 1.5, 0.03
"""Segments of two looks that are no further apart are one that stands still."""
OVERLAP = 0.5
"""So much of the shorter one must lie beside the other."""
LEAST_TWINS, LEAST_PART = 2, 0.6
"""Chance makes a twin in one look, or in a few of many: there must be one in so many, and in such a part of them."""
LEAST_AREA, MOST_AREA = 0.01, 0.5
"""A smaller part of a picture is not worth being left out. Where a larger one stands still, the robot did not turn."""
MOSTLY = 80.0
"""To each end a side is as long as it is in all but the longest fifth of what shows it (percent)."""
LEAST_SIDES, MOST_LEFT_OUT = 3, 4
"""Fewer lines have no outline; so many may be left out as chance."""
INSIDE_PX, MOST_INSIDE = 8.0, 0.1
"""Within the outline, further in than so, nothing of the building is seen: no more than such a part of its length."""


def find_obstruction(
    glances: Sequence[CameraView], camera: Camera, least_area: float = LEAST_AREA
) -> Obstruction | None:
    """What hides the same part of all looks; None where nothing does, or looks in too few directions were taken.

    Its outline is round what stands still. Were it not opaque, other segments would be seen within. Then one thing that
    may stand still by chance is left out after the other, and then all that do so in the fewest looks, until nothing is
    to be left. ``least_area`` is the least part of the picture.
    """
    found = [_twins(glances, k) for k in range(len(glances))]
    for least in range(LEAST_TWINS, len(glances)):
        still = [twins >= max(least, LEAST_PART * others) for twins, others in found]
        sides = _sides([g.segments_px[some] for g, some in zip(glances, still, strict=True)])
        passing = [g.segments_px[~some] for g, some in zip(glances, still, strict=True)]
        for _ in range(1 + MOST_LEFT_OUT):
            obstruction = _round_all(sides, camera, least_area)
            if obstruction is not None and is_opaque(obstruction, passing):
                return obstruction
            if len(sides) <= LEAST_SIDES:
                break
            sides, passing = _without_worst(sides, passing, camera)
    return None


def update_obstruction(
    glances: Sequence[CameraView], camera: Camera, known: Obstruction | None, least_area: float = LEAST_AREA
) -> Obstruction | None:
    """What stands before the camera, by these looks; else what was found before, unless it is not opaque now."""
    found = find_obstruction(glances, camera, least_area)
    if found is None and known is not None and is_opaque(known, [g.segments_px for g in glances]):
        return known
    return found


def is_opaque(obstruction: Obstruction, seen: Sequence[Floats]) -> bool:
    """Whether of the segments (n, 2, 2) of several looks hardly any lie within its outline."""
    return _share_within(obstruction, seen) <= MOST_INSIDE


def _share_within(obstruction: Obstruction, seen: Sequence[Floats]) -> float:
    """Of segments the length that lies within an outline, to the outline's own length in all looks."""
    inside = math.fsum(float(np.sum(_lengths(s) * obstruction.hidden_part(s, -INSIDE_PX))) for s in seen)
    return inside / (len(seen) * _round(np.array(obstruction.outline_px)))


@dataclass(frozen=True, slots=True, eq=False)
class _Side:
    """One line that stands still: (2, 2) its ends [px], and (n, 2, 2) the segments that show it."""

    ends_px: Floats
    segments_px: Floats


def _sides(still: Sequence[Floats]) -> list[_Side]:
    """What the segments (n, 2, 2) of all looks that stand still show: those that lie on each other are of one side.

    In some looks a side goes on in an edge of the building, or is seen in part only.
    """
    segments = np.concatenate([np.zeros((0, 2, 2)), *still])
    if not len(segments):
        return []
    count, which = connected_components(_lie_on(segments, segments), directed=False)
    return [_Side(_typical(segments[which == k]), segments[which == k]) for k in range(count)]


def _typical(segments_px: Floats) -> Floats:
    """(2, 2) the ends of what segments (n, 2, 2) on one line show, but for those that go on in something else."""
    longest = segments_px[np.argmax(_lengths(segments_px))]
    along = (longest[1] - longest[0]) / _lengths(longest[None])[0]
    at = np.sort((segments_px - longest[0]) @ along, axis=1)
    across = (segments_px - longest[0]) @ np.array([-along[1], along[0]])
    low, high = np.percentile(at[:, 0], 100.0 - MOSTLY), np.percentile(at[:, 1], MOSTLY)
    return np.asarray(longest[0] + np.outer([low, high], along)
                      + float(np.median(across)) * np.array([-along[1], along[0]]))


def _round_all(sides: Sequence[_Side], camera: Camera, least_area: float = 0.0) -> Obstruction | None:
    """The outline round sides; None where it is a smaller part of the picture, or a larger one than can be."""
    corners = np.array([side.ends_px for side in sides]).reshape(-1, 2)
    if len(corners) < 3:
        return None
    hull = cv2.approxPolyDP(cv2.convexHull(corners.astype(np.float32)), OFF_PX, True)
    corners = np.round(np.asarray(hull, float).reshape(-1, 2))
    if len(corners) < 3 or not least_area <= _area(corners) / (camera.width * camera.height) <= MOST_AREA:
        return None
    return Obstruction(tuple((float(x), float(y)) for x, y in corners))


def _without_worst(
    sides: list[_Side], passing: list[Floats], camera: Camera
) -> tuple[list[_Side], list[Floats]]:
    """Without the side beyond which least is seen within the outline; its segments are then of the building."""
    rated: list[tuple[float, int, list[Floats]]] = []
    for k, side in enumerate(sides):
        outline = _round_all([*sides[:k], *sides[k + 1 :]], camera)
        seen = [np.concatenate([passing[0], side.segments_px]), *passing[1:]]
        rated.append((math.inf if outline is None else _share_within(outline, seen), k, seen))
    _, worst, seen = min(rated, key=lambda one: one[:2])
    return [*sides[:worst], *sides[worst + 1 :]], seen


def _twins(glances: Sequence[CameraView], which: int) -> tuple[NDArray[np.int64], int]:
    """(n,) in how many looks in other directions each segment of one look has a twin, and how many of those there are.
    """
    one = glances[which]
    others = [g for g in glances
              if abs(wrap_angle(g.now_from_then.heading_rad - one.now_from_then.heading_rad)) > TURNED_RAD]
    twins = [has_counterpart(one.segments_px, other.segments_px) for other in others]
    return np.sum([np.zeros(len(one.segments_px), np.int64), *twins], axis=0), len(others)


def has_counterpart(one_px: Floats, other_px: Floats) -> NDArray[np.bool_]:
    """(n,) which segments (n, 2, 2) lie on, and beside, one of others (m, 2, 2)."""
    return np.asarray(np.any(_lie_on(one_px, other_px), axis=1))


def _lie_on(one_px: Floats, other_px: Floats) -> NDArray[np.bool_]:
    """(n, m) which segments (n, 2, 2) lie on, and beside, which of others (m, 2, 2)."""
    if not len(one_px) or not len(other_px):
        return np.zeros((len(one_px), len(other_px)), bool)
    length, size = _lengths(one_px), _lengths(other_px)
    along = (one_px[:, 1] - one_px[:, 0]) / length[:, None]
    direction = (other_px[:, 1] - other_px[:, 0]) / size[:, None]
    turned = np.abs(along[:, None, 0] * direction[None, :, 1] - along[:, None, 1] * direction[None, :, 0])
    away = other_px[None] - one_px[:, None, None, 0]  # (n, m, 2, 2)
    across = np.abs(away[..., 0] * along[:, None, None, 1] - away[..., 1] * along[:, None, None, 0]).max(axis=2)
    at = away[..., 0] * along[:, None, None, 0] + away[..., 1] * along[:, None, None, 1]
    shared = np.minimum(at.max(axis=2), length[:, None]) - np.maximum(at.min(axis=2), 0.0)
    beside = shared >= OVERLAP * np.minimum(length[:, None], size[None])
    return np.asarray((turned <= OFF_RAD) & (across <= OFF_PX) & beside)


def _lengths(segments_px: Floats) -> Floats:
    return np.asarray(np.maximum(np.linalg.norm(segments_px[:, 1] - segments_px[:, 0], axis=1), 1e-9))


def _area(hull: Any) -> float:
    return abs(float(cv2.contourArea(hull.astype(np.float32))))


def _round(hull: Floats) -> float:
    return float(np.sum(np.linalg.norm(np.roll(hull, -1, axis=0) - hull, axis=1)))
