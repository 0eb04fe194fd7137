"""Regions of a picture that do not look like the floor: where they stand, and do they stand up from it?

An earlier picture tells the latter (``relief``): what lies flat moves as the floor does, what stands moves differently.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.polygon import orient

from knowledge_sources.methods.arrays import Floats, Ints
from knowledge_sources.methods.floor.model_floor import SIGHT_M, FloorGrid
from knowledge_sources.methods.floor.relief import FLAT, STANDING, UNCONFIRMED, Relief

MIN_THING_PIXELS = 10  # smallest region, in pixels of half the picture's size
SEEN_DEPTH_M = 0.05  # depth of a foot
MAX_THING_DEPTH_M = 0.8  # feet of one thing are at most so much further than its nearest

CUT_DEPTH_M = 0.15  # the same where the lower border of the picture cuts it off

MIN_BORDER_COLUMNS = 6
"""Fewer columns that are seen to stand tell nothing of those beside them."""
MIN_AGREEING_COLUMNS, RANGE_ERROR = 3, 0.12
"""So many columns beside each other tell how far what stands is, if they agree to this part of that."""
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
        parts: (k,) how far the feet are, as parts of the distances of the floor that they hide: 1 on the floor, less
            where the earlier picture shows that what is seen hangs over it, or that the foot is not to be seen.
        is_cut: whether the picture's lower border cuts it off: its foot is nearer than what is seen.
        is_clipped: whether it goes on above what is looked at: its top is not seen.
        top: (2,) row and column of its highest pixel.
    """

    mask: NDArray[np.bool_]
    feet: Ints
    parts: Floats
    is_cut: bool
    is_clipped: bool
    top: tuple[int, int]


def find_regions(
    unlike: NDArray[np.bool_], tells: NDArray[np.bool_], grid: FloorGrid, relief: Relief | None = None
) -> tuple[StandingRegion, ...]:
    """The regions of unlike pixels, and of those that stand up from the floor, the largest first.

    Args:
        unlike: (rows, columns) what does not look like the floor; tells: where that tells anything.
        relief: by an earlier picture, if there is one.
    """
    seen = _drop_slivers(unlike & tells, tells)
    parts, kinds = np.ones(grid.shape, np.float32), np.full(grid.shape, UNCONFIRMED)
    if relief is not None:
        kinds = relief.kinds
        parts = np.where(drop_specks((relief.kinds == STANDING) & tells), relief.parts, parts)
        seen |= parts < 1.0
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
        region = _describe_region(mask, tells, grid, parts, kinds)
        if region is not None:
            found.append(region)
    return tuple(found)


def _describe_region(
    mask: NDArray[np.bool_], tells: NDArray[np.bool_], grid: FloorGrid, parts: NDArray[np.float32],
    kinds: NDArray[np.uint8],
) -> StandingRegion | None:
    columns = np.flatnonzero(mask.any(axis=0))
    lowest = mask.shape[0] - 1 - np.argmax(mask[::-1, columns], axis=0)
    last = mask.shape[0] - 1
    # what is seen to stand stands at its own distance, though its foot looks like the floor or is not in the picture
    seeming = grid.ranges_m[lowest, columns]
    standing_m = _agree(_measure_standing_m(mask[:, columns], (grid.ranges_m * parts)[:, columns], parts[:, columns]))
    told = np.flatnonzero(np.isfinite(standing_m))
    if len(told) >= MIN_BORDER_COLUMNS:  # where no foot is to be seen, it is as far as that of the nearest column is
        beside = told[np.argmin(np.abs(columns[:, None] - columns[told]), axis=1)]
        hangs = (lowest >= last - 1) | _is_border_standing(lowest, columns, parts, kinds)
        standing_m = np.where(hangs, standing_m[beside], standing_m)
    ranges = np.minimum(seeming, standing_m)
    is_confirmed = ranges < seeming
    cut = (lowest >= last - 1) & ~is_confirmed
    # below a foot there is floor; where the model's own parts begin there, it is no foot
    stands = is_confirmed | cut | tells[np.minimum(lowest + 2, last), columns]
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
    parts_of = (ranges / seeming)[is_foot]
    top = int(highest[k]), int(columns[k])
    return StandingRegion(mask, feet, parts_of, bool(cut[is_foot].any()), is_clipped, top)


def _is_border_standing(
    lowest: NDArray[np.intp], columns: NDArray[np.intp], parts: NDArray[np.float32], kinds: NDArray[np.uint8]
) -> bool:
    """Whether the lower border of a region stands: it hangs over the floor, as that of a shelf on legs.

    Not all of it is at one height then: a leg is a part of it.
    """
    rows = np.clip(lowest[:, None] + np.arange(-2, 3), 0, kinds.shape[0] - 1)
    seen, at = kinds[rows, columns[:, None]], parts[rows, columns[:, None]]
    counted = np.count_nonzero(((seen == STANDING) & (at < 1.0)).any(axis=1))
    return bool(counted >= MIN_BORDER_COLUMNS and counted > np.count_nonzero((seen == FLAT).any(axis=1)))


def _measure_standing_m(mask: NDArray[np.bool_], ranges_m: Floats, parts: NDArray[np.float32]) -> Floats:
    """(k,) how far what stands in each of k columns is; infinite where nothing is seen to stand.

    In a column the lower quarter of its pixels decides, and of five neighbouring columns the middle one: by chance some
    patch is like another.
    """
    standing = mask & (parts < 1.0)
    ordered = np.sort(np.where(standing, ranges_m, np.inf), axis=0)
    counts = np.count_nonzero(standing, axis=0)
    own = ordered[np.maximum(counts - 1, 0) // 4, np.arange(len(counts))]
    around = np.lib.stride_tricks.sliding_window_view(np.pad(own, 2, constant_values=np.inf), 5)
    known = np.sort(around, axis=1)
    middle = known[np.arange(len(own)), np.maximum(np.isfinite(around).sum(axis=1) - 1, 0) // 2]
    return np.where(counts > 0, middle, np.inf)


def _agree(standing_m: Floats) -> Floats:
    """The same (k,) without the few columns that no other bears out, where many agree: their texture is like itself."""
    told = np.flatnonzero(np.isfinite(standing_m))
    is_same = np.abs(np.log(standing_m[told, None] / standing_m[told])) <= RANGE_ERROR
    agreeing = np.count_nonzero(is_same, axis=1)
    if agreeing.max(initial=0) >= MIN_BORDER_COLUMNS:
        standing_m[told[agreeing < MIN_AGREEING_COLUMNS]] = np.inf
    return standing_m


def _find_feet(
    columns: NDArray[np.intp], ranges: Floats, stands: NDArray[np.bool_], cut: NDArray[np.bool_], nearest: float,
) -> NDArray[np.bool_]:
    """Which columns (k,) of a region have a foot on the floor, by the ranges (k,) at which it seems to stand.

    What hangs over the floor seems to stand much further off than the feet do: a foot is within the depth of a thing
    from the nearest, or its column is next to such a one and stands about as far off. Where the picture's border cuts
    the feet off, only what is as near as that border tells where they are, and nothing further off than a thing is
    deep: its slanting side leads away from there.
    """
    deep_m = CUT_DEPTH_M if cut.any() else MAX_THING_DEPTH_M
    is_foot = stands & (ranges <= nearest + deep_m)
    for order in (range(1, len(columns)), range(len(columns) - 2, -1, -1)):
        for i in order:
            j = i - order.step
            is_next = columns[i] - columns[j] == order.step
            if is_foot[j] and stands[i] and is_next and abs(ranges[i] - ranges[j]) <= MAX_STEP * ranges[j]:
                is_foot[i] = True
    return is_foot & (ranges <= nearest + MAX_THING_DEPTH_M) if cut.any() else is_foot


def drop_specks(standing: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Without what is too small: by chance some patch is like another."""
    count, labels = cv2.connectedComponents(_widen(standing).astype(np.uint8), connectivity=8)
    sizes = np.bincount(labels[standing], minlength=count)
    return np.asarray(standing & (sizes >= MIN_THING_PIXELS)[labels])


def _drop_slivers(seen: NDArray[np.bool_], tells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Without the columns of pixels that are few and end at the model's own parts: an edge that is a little off."""
    thick = cv2.erode(seen.astype(np.uint8), np.ones((MIN_ROWS, 1), np.uint8), borderValue=1)
    thick = cv2.dilate(thick, np.ones((MIN_ROWS, 1), np.uint8))
    above = np.zeros_like(seen)
    above[MIN_ROWS:] = ~tells[:-MIN_ROWS]
    above[:MIN_ROWS] = True
    return np.asarray(seen & ((thick > 0) | ~above))


def find_footprint(region: StandingRegion, grid: FloorGrid) -> Floats:
    """(k, 2) corners, counter-clockwise, robot's frame, of what a region takes of the floor [m].

    It is the hull of its feet, and of the same points a little further off.
    """
    eye = grid.eye_robot
    away = region.parts[:, None] * (grid.points_robot[region.feet[:, 0], region.feet[:, 1]] - eye)
    points = eye + away
    lengths = np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)
    cut = (region.feet[:, 0] >= grid.shape[0] - 2) & (region.parts == 1.0)
    near = np.where(cut[:, None], eye + away * CUT_PART, points)
    deep_m = np.where(cut[:, None], 0.0, SEEN_DEPTH_M)  # what is cut off is nearer than the border of the picture
    far = points + away / lengths * deep_m
    hull = shapely.convex_hull(shapely.multipoints(np.concatenate([near, far])))
    if not isinstance(hull, shapely.Polygon):
        hull = hull.buffer(0.02, quad_segs=1)
    slim = hull.simplify(0.01)
    return np.asarray(orient(slim if isinstance(slim, shapely.Polygon) else hull).exterior.coords)[:-1, :2]


def measure_height(region: StandingRegion, grid: FloorGrid) -> tuple[float, float]:
    """Height of a region's top [m] if it stands up from its feet, and its standard deviation; infinite if unknown."""
    row, column = region.top
    ranges = grid.ranges_m[region.feet[:, 0], region.feet[:, 1]] * region.parts
    foot_m = float(ranges.min()) * (CUT_PART if region.is_cut else 1.0)
    top_m = float(grid.ranges_m[row, column])
    height = grid.camera_height_m * (1.0 - min(1.0, foot_m / top_m)) if np.isfinite(top_m) else grid.camera_height_m
    if region.is_clipped or region.is_cut:
        return height, float("inf")
    return height, 0.03 + 0.05 * foot_m * height


P_CONFIRMED = 0.98
"""Probability that what clearly stands, or clearly lies flat, by another picture, does so."""
CLEAR, FEW, MOST_CLEAR = 20, 6, 1.5
"""So many pixels that tell are clear; fewer tell less, few nothing, and many as much as half as many again."""
MIN_STANDING_SHARE, MIN_FLAT_SHARE = 0.6, 0.8
"""Least shares of the pixels that tell, by which a region is said to stand or to lie flat."""
LOW_TOP_M = 0.08  # the top of what is low, but not rolled over


def compute_parallax_odds(region: StandingRegion, relief: Relief, grid: FloorGrid) -> float:
    """The odds that a region is solid against flat or reflected, by an earlier picture; 1 where nothing tells.

    Asked are its pixels that, if it were solid, would be so much nearer than the floor behind them that they are told
    from it: as near as its foot, or as the top of something low, as a plank. Of those round it, which show the floor
    behind it too, only what stands tells.
    """
    near, foot_m = _widen(region.mask), np.full(grid.shape[1], np.inf)
    foot_m[region.feet[:, 1]] = grid.ranges_m[region.feet[:, 0], region.feet[:, 1]] * region.parts
    foot_m[np.isinf(foot_m)] = foot_m.min()
    low = 1.0 - LOW_TOP_M / grid.camera_height_m
    tested = near & relief.tells_of(np.clip(foot_m / grid.ranges_m, low, 1.0))
    stand = np.count_nonzero(near & (relief.kinds == STANDING))
    flat = np.count_nonzero(region.mask & tested & (relief.kinds == FLAT))
    counted = max(stand, flat)
    if counted < FEW or counted < (MIN_STANDING_SHARE if stand > flat else MIN_FLAT_SHARE) * (stand + flat):
        return 1.0
    odds = (P_CONFIRMED / (1.0 - P_CONFIRMED)) ** min(MOST_CLEAR, counted / CLEAR)
    return float(odds if stand > flat else 1.0 / odds)


def _widen(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """A mask and the pixels round it."""
    return np.asarray(cv2.dilate(mask.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0)
