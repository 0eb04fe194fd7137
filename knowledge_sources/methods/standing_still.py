"""What stands still in the picture while the robot turns is before its camera, and not in the building (§4: a model is
incomplete, and so is a view)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.glances import Glance
from world_models.camera import Camera
from world_models.frames import wrap_angle
from world_models.obstruction import Obstruction

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
INSIDE_PX, MOST_INSIDE = 8.0, 0.1
"""Within the outline, further in than so, nothing of the building is seen: no more than such a part of its length."""


def obstruction_in(glances: Sequence[Glance], camera: Camera, least_area: float = LEAST_AREA) -> Obstruction | None:
    """What hides the same part of all looks; None where nothing does, or looks in too few directions were taken.

    Its outline is round the segments that stand still. Were it not opaque, other segments would be seen within: then
    those that stand still in the fewest looks are left out, as they may do so by chance, until nothing is to be left.
    ``least_area`` is the least part of the picture.
    """
    found = [_twins(glances, k) for k in range(len(glances))]
    for least in range(LEAST_TWINS, len(glances)):
        still = [twins >= max(least, LEAST_PART * others) for twins, others in found]
        hull = _hull(glances, still)
        part = _area(hull) / (camera.width * camera.height) if len(hull) >= 3 else 0.0
        if part < least_area:
            return None
        if part > MOST_AREA:
            continue
        obstruction = Obstruction(tuple((float(x), float(y)) for x, y in hull))
        if is_opaque(obstruction, [g.segments_px[~some] for g, some in zip(glances, still, strict=True)]):
            return obstruction
    return None


def before_camera(
    glances: Sequence[Glance], camera: Camera, known: Obstruction | None, least_area: float = LEAST_AREA
) -> Obstruction | None:
    """What stands before the camera, by these looks; else what was found before, unless it is not opaque now."""
    found = obstruction_in(glances, camera, least_area)
    if found is None and known is not None and is_opaque(known, [g.segments_px for g in glances]):
        return known
    return found


def is_opaque(obstruction: Obstruction, seen: Sequence[Floats]) -> bool:
    """Whether of the segments (n, 2, 2) of several looks hardly any lie within its outline."""
    inside = math.fsum(float(np.sum(_lengths(s) * obstruction.hidden_part(s, -INSIDE_PX))) for s in seen)
    return inside <= MOST_INSIDE * len(seen) * _round(np.array(obstruction.outline_px))


def _hull(glances: Sequence[Glance], which: Sequence[NDArray[np.bool_]]) -> Floats:
    """(k, 2) the corners round some of the segments of all looks."""
    corners = np.concatenate([np.zeros((0, 2)), *(g.segments_px[some].reshape(-1, 2)
                                                  for g, some in zip(glances, which, strict=True))])
    if len(corners) < 3:
        return corners
    hull = cv2.approxPolyDP(cv2.convexHull(corners.astype(np.float32)), OFF_PX, True)
    return np.round(np.asarray(hull, float).reshape(-1, 2))


def _twins(glances: Sequence[Glance], which: int) -> tuple[NDArray[np.int64], int]:
    """(n,) in how many looks in other directions each segment of one look has a twin, and how many of those there are.
    """
    one = glances[which]
    others = [g for g in glances
              if abs(wrap_angle(g.now_from_then.heading_rad - one.now_from_then.heading_rad)) > TURNED_RAD]
    twins = [twinned(one.segments_px, other.segments_px) for other in others]
    return np.sum([np.zeros(len(one.segments_px), np.int64), *twins], axis=0), len(others)


def twinned(one_px: Floats, other_px: Floats) -> NDArray[np.bool_]:
    """(n,) which segments (n, 2, 2) lie on, and beside, one of others (m, 2, 2)."""
    if not len(one_px) or not len(other_px):
        return np.zeros(len(one_px), bool)
    length, size = _lengths(one_px), _lengths(other_px)
    along = (one_px[:, 1] - one_px[:, 0]) / length[:, None]
    direction = (other_px[:, 1] - other_px[:, 0]) / size[:, None]
    turned = np.abs(along[:, None, 0] * direction[None, :, 1] - along[:, None, 1] * direction[None, :, 0])
    away = other_px[None] - one_px[:, None, None, 0]  # (n, m, 2, 2)
    across = np.abs(away[..., 0] * along[:, None, None, 1] - away[..., 1] * along[:, None, None, 0]).max(axis=2)
    at = away[..., 0] * along[:, None, None, 0] + away[..., 1] * along[:, None, None, 1]
    shared = np.minimum(at.max(axis=2), length[:, None]) - np.maximum(at.min(axis=2), 0.0)
    beside = shared >= OVERLAP * np.minimum(length[:, None], size[None])
    return np.asarray(np.any((turned <= OFF_RAD) & (across <= OFF_PX) & beside, axis=1))


def _lengths(segments_px: Floats) -> Floats:
    return np.asarray(np.maximum(np.linalg.norm(segments_px[:, 1] - segments_px[:, 0], axis=1), 1e-9))


def _area(hull: Any) -> float:
    return abs(float(cv2.contourArea(hull.astype(np.float32))))


def _round(hull: Floats) -> float:
    return float(np.sum(np.linalg.norm(np.roll(hull, -1, axis=0) - hull, axis=1)))
