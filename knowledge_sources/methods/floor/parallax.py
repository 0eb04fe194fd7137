"""Does a region stand up from the floor, lie flat on it, or is it reflected in it? Its top in two pictures with known
motion between them.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.floor.floor_grid import STEP_PX, FloorGrid
from knowledge_sources.methods.floor.things import Region
from world_models.camera import NEAR_PLANE_M, Camera, CameraMount
from world_models.frames import Pose2

MIN_PARALLAX_PX = 3.0  # parallax tells where solid and flat things differ by at least this
PARALLAX_ODDS = 50.0  # odds that one clear comparison of two pictures is worth
MIN_PARALLAX_CORRELATION = 0.5  # smallest correlation of two patches that tells anything
MIN_PARALLAX_MARGIN = 0.15  # smallest difference of the correlations of the two hypotheses that tells anything
FOOT_PART_STEP = 0.05  # distances at which a lower border may hang over the floor are tried in steps of this part
MIN_FOOT_PART = 0.4  # least part of its seeming distance at which a lower border is looked for
MIN_FOOT_MARGIN = 0.07
"""Smallest difference of the mean correlations of a lower border over the floor and on it that tells anything."""
MIN_FOOT_COLUMNS = 6  # with fewer patches of a lower border its height is not told

HALF = 4
"""Patches are squares of 2 HALF + 1 pixels of the reduced picture."""
COLUMNS = 8
"""Places of a region's upper border that are compared."""
PLACES = (0.5, 0.75, 1.0, 1.25)
"""Where its top may be between the floor behind it (0) and right above its foot (1): what is deep has its upper border
further back than its foot, and the foot of what is cut off is nearer than it is taken to be."""
DEPTHS = tuple(1.25 * 1.18**step for step in range(10))
"""Where a mirror image is: so many times as far away as the floor. That of a thing of height h, with the camera at
height c above the floor, is 1 + h / c times as far."""
MIN_DEVIATION = 4.0
"""A patch with less contrast than this [grey levels] tells nothing."""


def compute_parallax_odds(
    region: Region, grid: FloorGrid, picture: NDArray[np.float32], earlier: NDArray[np.float32],
    earlier_from_now: Pose2, camera: Camera, mount: CameraMount,
) -> float:
    """The odds that a region is solid against flat or reflected, by an earlier picture; 1 where nothing tells.

    Points of the upper border are on the floor if the region is flat, above its foot if it is solid, and below the
    floor if a shiny floor mirrors what is elsewhere. Where they were in the earlier picture then differs; the patch
    round each tells which of these it is.

    Args:
        picture, earlier: (h, w) grey, reduced by STEP_PX.
        earlier_from_now: the robot's pose now in its frame then.
    """
    rows, columns = _find_upper_border(region)
    if not len(rows):
        return 1.0
    points = grid.points_robot[rows, columns]
    eye = np.array([mount.forward_m, 0.0])
    ranges = np.linalg.norm(points - eye, axis=1)
    foot_of = {int(column): float(grid.ranges_m[row, column]) for row, column in region.feet}
    foot_m = np.array([foot_of.get(int(column), min(foot_of.values())) for column in columns])
    part = np.minimum(foot_m / ranges, 1.0)
    flat = np.column_stack([points, np.zeros(len(points))])
    then_flat = _project(flat, earlier_from_now, camera, mount, grid)
    then_solid = []
    for share in PLACES:
        at = 1.0 - share * (1.0 - part)
        solid = np.column_stack([eye + (points - eye) * at[:, None], grid.camera_height_m * (1.0 - at)])
        then_solid.append(_project(solid, earlier_from_now, camera, mount, grid))
    then_mirrored = [_project(_below(points, eye, depth, grid), earlier_from_now, camera, mount, grid)
                     for depth in DEPTHS]
    votes = 0
    for i in range(len(points)):
        patch = _cut(picture, grid.top + int(rows[i]), int(columns[i]))
        as_flat = _correlate(earlier, patch, then_flat[i])
        as_solid, as_mirrored = (
            _correlate_best(earlier, patch, then_flat[i], [there[i] for there in then], MIN_PARALLAX_PX)
            for then in (then_solid, then_mirrored))
        as_solid = as_flat if as_solid is None else as_solid  # too near to each other to tell them apart
        lying = as_flat if as_mirrored is None else max(as_flat, as_mirrored)
        is_found = max(lying, as_solid) >= MIN_PARALLAX_CORRELATION
        if is_found and abs(as_solid - lying) >= MIN_PARALLAX_MARGIN:
            votes += 1 if as_solid > lying else -1
    if votes == 0:
        return 1.0
    return float(PARALLAX_ODDS ** np.clip(votes / 2.0, -1.0, 1.0))


def measure_foot_part(
    region: Region, grid: FloorGrid, picture: NDArray[np.float32], earlier: NDArray[np.float32],
    earlier_from_now: Pose2, camera: Camera, mount: CameraMount,
) -> float:
    """How far a region's lower border is, as a part of the distance at which it would stand on the floor; 1: it does.

    The lower border of what hangs over the floor, as a shelf on legs, hides floor that is further away: it moves
    otherwise between two pictures than floor does. All of the border is taken to be at one height.

    Args:
        picture, earlier: (h, w) grey, reduced by STEP_PX.
        earlier_from_now: the robot's pose now in its frame then.
    """
    feet = region.feet[region.feet[:, 0] < grid.shape[0] - 2]
    if not len(feet):
        return 1.0
    feet = feet[np.unique(np.linspace(0, len(feet) - 1, min(COLUMNS, len(feet))).astype(int))]
    points = grid.points_robot[feet[:, 0], feet[:, 1]]
    parts = np.arange(1.0, MIN_FOOT_PART - 1e-9, -FOOT_PART_STEP)
    eye = np.array([mount.forward_m, 0.0])
    then = np.stack([_project(_below(points, eye, part, grid), earlier_from_now, camera, mount, grid)
                     for part in parts])
    patches = [_cut(picture, grid.top + row, column) for row, column in feet]
    alike = np.array([[_correlate(earlier, patch, at) for patch, at in zip(patches, there, strict=True)]
                      for there in then])
    shown = alike[0] > -1.0
    if np.count_nonzero(shown) < MIN_FOOT_COLUMNS:
        return 1.0
    mean = alike[:, shown].mean(axis=1)
    apart = np.linalg.norm(then - then[0], axis=2)[:, shown].mean(axis=1) * STEP_PX
    best = int(np.argmax(mean))
    tells = mean[best] >= MIN_PARALLAX_CORRELATION and apart[best] >= MIN_PARALLAX_PX
    return float(parts[best]) if tells and mean[best] - mean[0] >= MIN_FOOT_MARGIN else 1.0


def _below(points: Floats, eye: Floats, depth: float, grid: FloorGrid) -> Floats:
    """(n, 3) points on the rays to floor points (n, 2), so many times as far away."""
    height = np.full(len(points), grid.camera_height_m * (1.0 - depth))
    return np.column_stack([eye + (points - eye) * depth, height])


def _find_upper_border(region: Region) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns of some pixels of the upper border, spread over the region."""
    if region.is_clipped:
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    columns = np.flatnonzero(region.mask.any(axis=0))
    some = np.unique(columns[np.linspace(0, len(columns) - 1, min(COLUMNS, len(columns))).astype(int)])
    return np.argmax(region.mask[:, some], axis=0), some


def _project(points_robot: Floats, earlier_from_now: Pose2, camera: Camera, mount: CameraMount, grid: FloorGrid
             ) -> Floats:
    """Where points (n, 3) of the robot's frame now were in the earlier picture, reduced [px]; NaN behind it."""
    flat = earlier_from_now.apply(points_robot[:, :2])
    height = mount.height_m - grid.camera_height_m  # of the floor above the plan on which poses are
    there = mount.camera_from_robot.apply(np.column_stack([flat, points_robot[:, 2] + height]))
    ahead = there[:, 2] > NEAR_PLANE_M
    pixels = camera.project(np.where(ahead[:, None], there, (0.0, 0.0, 1.0)))
    pixels[~ahead] = np.nan
    return np.asarray((pixels + 0.5) / STEP_PX - 0.5)


def _cut(picture: NDArray[np.float32], row: float, column: float) -> NDArray[np.float32]:
    size = (2 * HALF + 1, 2 * HALF + 1)
    return np.asarray(cv2.getRectSubPix(picture, size, (float(column), float(row))), np.float32)


def _correlate(earlier: NDArray[np.float32], patch: NDArray[np.float32], there: Floats) -> float:
    """Largest normalized correlation of a patch within a pixel of a place; -1 where it is not in the picture."""
    rows, columns = earlier.shape
    if not (np.isfinite(there).all() and HALF < there[0] < columns - HALF - 1 and HALF < there[1] < rows - HALF - 1):
        return -1.0
    size = 2 * (HALF + 1) + 1
    window = cv2.getRectSubPix(earlier, (size, size), (float(there[0]), float(there[1])))
    if patch.std() < MIN_DEVIATION or window.std() < MIN_DEVIATION:
        return -1.0
    return float(cv2.matchTemplate(window, patch, cv2.TM_CCOEFF_NORMED).max())


def _correlate_best(
    earlier: NDArray[np.float32], patch: NDArray[np.float32], flat: Floats, places: list[Floats], min_parallax_px: float
) -> float | None:
    """The largest correlation at those places that differ enough from where a flat region was; None where none does."""
    apart = [there for there in places if np.linalg.norm(there - flat) * STEP_PX >= min_parallax_px]
    return max((_correlate(earlier, patch, there) for there in apart), default=None)
