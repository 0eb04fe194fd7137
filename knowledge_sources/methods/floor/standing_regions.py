"""Regions of a picture that do not look like the floor: where they stand, and do they stand up from it?

Two pictures tell the latter: what lies flat moves as the floor does, what stands moves otherwise (parallax).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.polygon import orient

from knowledge_sources.methods.arrays import Floats, Ints
from knowledge_sources.methods.floor.model_floor import SIGHT_M, STEP_PX, FloorGrid
from world_models.camera import NEAR_PLANE_M, Camera, CameraMount
from world_models.frames import Pose2

MIN_THING_PIXELS = 10  # smallest region, in pixels of half the picture's size
ASSUMED_DEPTH_M = 0.3  # depth that a thing is taken to have behind what is seen of it
MAX_THING_DEPTH_M = 0.8  # feet of one thing are at most so much further than its nearest

MIN_ROWS = 3
"""A region of fewer rows is noise."""
MAX_STEP = 0.06
"""Neighbouring columns of one foot, as a wall's, differ in range by no more than this part."""
CUT_PART = 0.72
"""Of a region that the lower border cuts off: its foot is taken to be at this part of the range of that border."""


@dataclass(frozen=True, eq=False)
class StandingRegion:
    """A connected part of the picture that does not look like the floor.

    Attributes:
        mask: (rows, columns) of the grid.
        feet: (k, 2) row and column of each column's lowest pixel that may stand on the floor.
        is_cut: whether the picture's lower border cuts it off: its foot is nearer than what is seen.
        is_clipped: whether it goes on above what is looked at: its top is not seen.
        top: (2,) row and column of its highest pixel.
    """

    mask: NDArray[np.bool_]
    feet: Ints
    is_cut: bool
    is_clipped: bool
    top: tuple[int, int]


def find_regions(
    unlike: NDArray[np.bool_], tells: NDArray[np.bool_], grid: FloorGrid
) -> tuple[StandingRegion, ...]:
    """The regions of unlike pixels, the largest first.

    Args:
        unlike: (rows, columns) what does not look like the floor; tells: where that tells anything.
    """
    seen = _drop_slivers(unlike & tells, tells)
    near = cv2.dilate(seen.astype(np.uint8), np.ones((3, 3), np.uint8))
    count, labels, stats, _ = cv2.connectedComponentsWithStats(near, connectivity=8)
    found = []
    for i in sorted(range(1, count), key=lambda i: (-stats[i, cv2.CC_STAT_AREA], i)):
        mask = (labels == i) & seen
        if np.count_nonzero(mask) < MIN_THING_PIXELS:
            continue
        rows = np.flatnonzero(mask.any(axis=1))
        if len(rows) < MIN_ROWS:
            continue
        region = _describe_region(mask, tells, grid)
        if region is not None:
            found.append(region)
    return tuple(found)


def _describe_region(
    mask: NDArray[np.bool_], tells: NDArray[np.bool_], grid: FloorGrid
) -> StandingRegion | None:
    columns = np.flatnonzero(mask.any(axis=0))
    lowest = mask.shape[0] - 1 - np.argmax(mask[::-1, columns], axis=0)
    last = mask.shape[0] - 1
    cut = lowest >= last - 1
    ranges = grid.ranges_m[lowest, columns]
    # below a foot there is floor; where the model's own parts begin there, it is no foot
    stands = cut | tells[np.minimum(lowest + 2, last), columns]
    if not stands.any():
        return None
    nearest = float(ranges[stands].min())
    if nearest > SIGHT_M:
        return None
    is_foot = _find_feet(columns, ranges, stands, cut, nearest)
    highest = np.argmax(mask[:, columns], axis=0)
    k = int(np.argmin(highest))
    above = max(0, int(highest[k]) - 2)
    is_clipped = bool(highest[k] <= 1 or not tells[above, columns[k]])
    feet = np.stack([lowest[is_foot], columns[is_foot]], axis=1)
    return StandingRegion(mask, feet, bool(cut[is_foot].any()), is_clipped, (int(highest[k]), int(columns[k])))


def _find_feet(
    columns: NDArray[np.intp], ranges: Floats, stands: NDArray[np.bool_], cut: NDArray[np.bool_], nearest: float,
) -> NDArray[np.bool_]:
    """Which columns (k,) of a region have a foot on the floor, by the ranges (k,) at which it seems to stand.

    What hangs over the floor seems to stand much further off than the feet do: a foot is within the depth of a thing
    from the nearest, or its column is next to such a one and stands about as far off. Where the picture's border cuts
    the feet off, only what is as near as that border tells where they are.
    """
    deep_m = 0.5 * ASSUMED_DEPTH_M if cut.any() else MAX_THING_DEPTH_M
    is_foot = stands & (ranges <= nearest + deep_m)
    for order in (range(1, len(columns)), range(len(columns) - 2, -1, -1)):
        for i in order:
            j = i - order.step
            is_next = columns[i] - columns[j] == order.step
            if is_foot[j] and stands[i] and is_next and abs(ranges[i] - ranges[j]) <= MAX_STEP * ranges[j]:
                is_foot[i] = True
    return is_foot


def _drop_slivers(seen: NDArray[np.bool_], tells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Without the columns of pixels that are few and end at the model's own parts: an edge that is a little off."""
    thick = cv2.erode(seen.astype(np.uint8), np.ones((MIN_ROWS, 1), np.uint8), borderValue=1)
    thick = cv2.dilate(thick, np.ones((MIN_ROWS, 1), np.uint8))
    above = np.zeros_like(seen)
    above[MIN_ROWS:] = ~tells[:-MIN_ROWS]
    above[:MIN_ROWS] = True
    return np.asarray(seen & ((thick > 0) | ~above))


def find_footprint(region: StandingRegion, grid: FloorGrid, part: float = 1.0) -> Floats:
    """(k, 2) corners, counter-clockwise, robot's frame, of what a region takes of the floor [m].

    It is the hull of its feet, and of the same points further off by the depth that is assumed. What hangs over the
    floor is at a ``part`` of the distances at which its feet seem to be.
    """
    eye = grid.eye_robot
    away = part * (grid.points_robot[region.feet[:, 0], region.feet[:, 1]] - eye)
    points = eye + away
    lengths = np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)
    cut = region.feet[:, 0] >= grid.shape[0] - 2
    near = np.where(cut[:, None], eye + away * CUT_PART, points)
    nearest = float(np.linalg.norm(near - eye, axis=1).min())
    deep = np.clip(nearest + ASSUMED_DEPTH_M - lengths, 0.1, ASSUMED_DEPTH_M)
    far = points + away / lengths * np.where(cut[:, None], 0.0, deep)  # one that is cut off is nearer than its border
    hull = shapely.convex_hull(shapely.multipoints(np.concatenate([near, far])))
    if not isinstance(hull, shapely.Polygon):
        hull = hull.buffer(0.02, quad_segs=1)
    slim = hull.simplify(0.01)
    return np.asarray(orient(slim if isinstance(slim, shapely.Polygon) else hull).exterior.coords)[:-1, :2]


def measure_height(region: StandingRegion, grid: FloorGrid, part: float = 1.0) -> tuple[float, float]:
    """Height of a region's top [m] if it stands up from its feet, and its standard deviation; infinite if unknown."""
    row, column = region.top
    ranges = grid.ranges_m[region.feet[:, 0], region.feet[:, 1]]
    foot_m = float(ranges.min()) * (CUT_PART if region.is_cut else part)
    top_m = float(grid.ranges_m[row, column])
    height = grid.camera_height_m * (1.0 - min(1.0, foot_m / top_m)) if np.isfinite(top_m) else grid.camera_height_m
    if region.is_clipped or region.is_cut:
        return height, float("inf")
    return height, 0.03 + 0.05 * foot_m * height


MIN_PARALLAX_PX = 3.0  # parallax tells where solid and flat things differ by at least this
PARALLAX_ODDS = 50.0  # odds that one clear comparison of two pictures is worth
MIN_PARALLAX_CORRELATION = 0.5  # smallest correlation of two patches that tells anything
MIN_PARALLAX_MARGIN = 0.15  # smallest difference of the correlations of the two hypotheses that tells anything
FOOT_PART_STEP = 0.05  # distances at which a lower border may hang over the floor are tried in steps of this part
MIN_FOOT_PART = 0.4  # least part of its seeming distance at which a lower border is looked for
MIN_FOOT_MARGIN = 0.07
"""Smallest difference of the mean correlations of a lower border over the floor and on it that tells anything."""
MIN_FIXED = 4  # fewest patches of a border that stay in the picture, by which it is on the lens
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


class TwoPictures(NamedTuple):
    """A picture and an earlier one: (h, w) grey, reduced by STEP_PX; and the robot's pose now in its frame then."""

    grid: FloorGrid
    picture: NDArray[np.float32]
    earlier: NDArray[np.float32]
    earlier_from_now: Pose2
    camera: Camera
    mount: CameraMount

    def cut(self, row: float, column: float) -> NDArray[np.float32]:
        """The patch round a pixel of the grid."""
        size, at = (2 * HALF + 1, 2 * HALF + 1), (float(column), float(self.grid.top + row))
        return np.asarray(cv2.getRectSubPix(self.picture, size, at), np.float32)

    def project(self, points_robot: Floats) -> Floats:
        """Where points (n, 3) of the robot's frame now were in the earlier picture, reduced [px]; NaN behind it."""
        flat = self.earlier_from_now.apply(points_robot[:, :2])
        height = self.mount.height_m - self.grid.camera_height_m  # of the floor above the plan on which poses are
        there = self.mount.camera_from_robot.apply(np.column_stack([flat, points_robot[:, 2] + height]))
        ahead = there[:, 2] > NEAR_PLANE_M
        pixels = self.camera.project(np.where(ahead[:, None], there, (0.0, 0.0, 1.0)))
        pixels[~ahead] = np.nan
        return np.asarray((pixels + 0.5) / STEP_PX - 0.5)

    def move_along(self, points: Floats, depth: float) -> Floats:
        """Where points on the rays to floor points (n, 2), so many times as far away, were in the earlier picture."""
        height = np.full(len(points), self.grid.camera_height_m * (1.0 - depth))
        eye = self.grid.eye_robot
        return self.project(np.column_stack([eye + (points - eye) * depth, height]))


def compute_parallax_odds(region: StandingRegion, both: TwoPictures) -> float:
    """The odds that a region is solid against flat or reflected, by an earlier picture; 1 where nothing tells.

    Points of the upper border are on the floor if the region is flat, above its foot if it is solid, and below the
    floor if a shiny floor mirrors what is elsewhere. Where they were in the earlier picture then differs; the patch
    round each tells which of these it is.
    """
    grid = both.grid
    rows, columns = _find_upper_border(region)
    if not len(rows):
        return 1.0
    points = grid.points_robot[rows, columns]
    eye = grid.eye_robot
    ranges = np.linalg.norm(points - eye, axis=1)
    foot_of = {int(column): float(grid.ranges_m[row, column]) for row, column in region.feet}
    foot_m = np.array([foot_of.get(int(column), min(foot_of.values())) for column in columns])
    part = np.minimum(foot_m / ranges, 1.0)
    flat = np.column_stack([points, np.zeros(len(points))])
    then_flat = both.project(flat)
    then_solid = []
    for share in PLACES:
        at = 1.0 - share * (1.0 - part)
        solid = np.column_stack([eye + (points - eye) * at[:, None], grid.camera_height_m * (1.0 - at)])
        then_solid.append(both.project(solid))
    then_mirrored = [both.move_along(points, depth) for depth in DEPTHS]
    votes = 0
    for i in range(len(points)):
        patch = both.cut(int(rows[i]), int(columns[i]))
        as_flat = _correlate(both.earlier, patch, then_flat[i])
        as_solid, as_mirrored = (
            _correlate_best(both.earlier, patch, then_flat[i], [there[i] for there in then])
            for then in (then_solid, then_mirrored))
        as_solid = as_flat if as_solid is None else as_solid  # too near to each other to tell them apart
        lying = as_flat if as_mirrored is None else max(as_flat, as_mirrored)
        is_found = max(lying, as_solid) >= MIN_PARALLAX_CORRELATION
        if is_found and abs(as_solid - lying) >= MIN_PARALLAX_MARGIN:
            votes += 1 if as_solid > lying else -1
    if votes == 0:
        return 1.0
    return float(PARALLAX_ODDS ** np.clip(votes / 2.0, -1.0, 1.0))


def is_on_the_lens(region: StandingRegion, both: TwoPictures) -> bool:
    """Whether a region stayed where it is in the picture while the robot moved: it is on the lens or before it.

    So it must be told from what lies on the floor there and from what stands there, by most of its border that tells.
    """
    grid = both.grid
    rows, columns = _find_upper_border(region)
    lower = region.feet[region.feet[:, 0] < grid.shape[0] - 2][::max(1, len(region.feet) // COLUMNS)]
    rows, columns = np.concatenate([rows, lower[:, 0]]), np.concatenate([columns, lower[:, 1]])
    if not len(rows):
        return False
    points, same = grid.points_robot[rows, columns], np.column_stack([columns, grid.top + rows]).astype(float)
    elsewhere = [both.move_along(points, part) for part in np.arange(1.0, MIN_FOOT_PART, -0.1)]
    fixed = other = 0
    for i in range(len(rows)):
        patch = both.cut(int(rows[i]), int(columns[i]))
        as_fixed = _correlate(both.earlier, patch, same[i])
        as_other = _correlate_best(both.earlier, patch, same[i], [there[i] for there in elsewhere])
        if as_other is None or max(as_fixed, as_other) < MIN_PARALLAX_CORRELATION:
            continue
        fixed += as_fixed - as_other >= MIN_PARALLAX_MARGIN
        other += as_other > as_fixed
    return fixed >= MIN_FIXED and fixed > 2 * other


def measure_foot_part(region: StandingRegion, both: TwoPictures) -> float:
    """How far a region's lower border is, as a part of the distance at which it would stand on the floor; 1: it does.

    The lower border of what hangs over the floor, as a shelf on legs, hides floor that is further away: it moves
    otherwise between two pictures than floor does. All of the border is taken to be at one height.
    """
    grid = both.grid
    feet = region.feet[region.feet[:, 0] < grid.shape[0] - 2]
    if not len(feet):
        return 1.0
    feet = feet[np.unique(np.linspace(0, len(feet) - 1, min(COLUMNS, len(feet))).astype(int))]
    points = grid.points_robot[feet[:, 0], feet[:, 1]]
    parts = np.arange(1.0, MIN_FOOT_PART - 1e-9, -FOOT_PART_STEP)
    then = np.stack([both.move_along(points, part) for part in parts])
    patches = [both.cut(row, column) for row, column in feet]
    alike = np.array([[_correlate(both.earlier, patch, at) for patch, at in zip(patches, there, strict=True)]
                      for there in then])
    shown = alike[0] > -1.0
    if np.count_nonzero(shown) < MIN_FOOT_COLUMNS:
        return 1.0
    mean = alike[:, shown].mean(axis=1)
    apart = np.linalg.norm(then - then[0], axis=2)[:, shown].mean(axis=1) * STEP_PX
    best = int(np.argmax(mean))
    tells = mean[best] >= MIN_PARALLAX_CORRELATION and apart[best] >= MIN_PARALLAX_PX
    return float(parts[best]) if tells and mean[best] - mean[0] >= MIN_FOOT_MARGIN else 1.0


def _find_upper_border(region: StandingRegion) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns of some pixels of the upper border, spread over the region."""
    if region.is_clipped:
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    columns = np.flatnonzero(region.mask.any(axis=0))
    some = np.unique(columns[np.linspace(0, len(columns) - 1, min(COLUMNS, len(columns))).astype(int)])
    return np.argmax(region.mask[:, some], axis=0), some


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
    earlier: NDArray[np.float32], patch: NDArray[np.float32], flat: Floats, places: list[Floats]
) -> float | None:
    """The largest correlation at those places that differ enough from where a flat region was; None where none does."""
    apart = [there for there in places if np.linalg.norm(there - flat) * STEP_PX >= MIN_PARALLAX_PX]
    return max((_correlate(earlier, patch, there) for there in apart), default=None)
