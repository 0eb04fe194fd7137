"""Relief: what of a picture stands up from the floor, what lies on it and what is on the lens, by an earlier picture.

The earlier picture is brought into this one as if all that it shows lay on the floor, on planes above and below it, or
on the lens (plane sweep, Collins, CVPR 1996). What a pixel shows is where the two are most alike. Where there is
no evidence, nothing is said: in plain surfaces, along lines that lead to where the robot comes from, far away.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache, reduce
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.floor.model_floor import STEP_PX, FloorGrid
from world_models.camera import NEAR_PLANE_M, Camera, CameraMount
from world_models.frames import Pose2

Grey = NDArray[np.float32]
UNCONFIRMED, FLAT, STANDING = range(3)

HALF = 3
"""Patches are squares of 2 HALF + 1 pixels of the reduced picture."""
REACH = 2 * HALF + 3
"""Side of the square round a pixel that its patch shows, and a little more."""
MIN_DEVIATION = 3.0
"""A patch with less contrast than this [grey levels] tells nothing."""
MIN_LIKENESS = 0.6
"""Least correlation of two patches that is evidence."""
MIN_LEAD = 0.25
"""Least lead over the correlations of all that it may be different."""
MIN_APART_PX = 2.5
"""Least distance, in the reduced earlier picture, of what stands from where it would lie flat."""
PARTS = (0.93, 0.86, 0.79, 0.72, 0.65, 0.57, 0.49, 0.41)
"""What stands is nearer than the floor that it hides: its distances that are tried, as parts of that of the floor."""
DEPTHS = (1.25, 1.5, 1.8, 2.15, 2.6, 3.1, 3.7)
"""And those of what a shiny floor mirrors: that of a thing of height h, with the camera at height c above the floor, is
1 + h / c times as far."""
LEAST_SIGMAS = (0.002, 0.002, 0.001)
"""Least standard deviations of the motion between two pictures [m, m, rad], before the floor is asked."""
ALIGN_STEPS = (0.01, 0.01, 0.004)
"""By so much it is changed to see what that changes in the picture."""
ALIGN_ROUNDS, MAX_LEFT_SIGMAS = 4, 0.1
"""At most so many rounds; none after one that changed the motion by less than so much of what is unsure of it."""
CONTRAST_SIGMA = 0.5
"""Of the contrast of floor that agrees."""
PATCH = 10.0
"""So many neighbouring pixels tell as much as one that tells on its own."""
MIN_AGREEING = 0.6
"""Least part of the floor with texture that must agree; else the motion is not known, and nothing is said."""
MIN_BESIDE_THINGS = 0.3
"""The same where what seems to stand is not counted."""
TYPICAL_M, MAX_UNSURE_PX = 2.0, 1.5
"""Floor at that distance must not be more unsure in the earlier picture, reduced, by the motion that is left open."""
NEAR_SHIFTS = ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))
MODEL_GAP_M = 0.35
"""What stands nearer than anything of the model by less than this may be that."""
MAX_HIDING_M = 0.2
"""What the model had before something, in the earlier picture, by more than this hid it."""
MIN_ALONG = 0.25
"""Least share of a patch's texture along the way on which what stands has moved: along a line there is no evidence."""
OUTSIDE = -1e4
"""Grey level of what is not in the earlier picture: one such pixel makes a patch's mean negative."""


class TwoPictures(NamedTuple):
    """A picture and an earlier one: (h, w) grey, reduced by STEP_PX; and the robot's pose now in its frame then."""

    grid: FloorGrid
    picture: Grey
    earlier: Grey
    earlier_from_now: Pose2
    camera: Camera
    mount: CameraMount

    def find_map(self, depth: float) -> Floats | None:
        """(3, 3) from pixels of the grid to the earlier picture, of what is ``depth`` times as far away as the floor.

        None where the earlier picture looked the other way. All of one depth is in a plane level with the floor.
        """
        seen = self._find_plane(depth)
        rows, columns = self.grid.shape
        corners = np.array([[0, 0, 1], [columns - 1, 0, 1], [columns - 1, rows - 1, 1], [0, rows - 1, 1]])
        if (corners @ seen[2] <= NEAR_PLANE_M * np.maximum(corners @ self.grid.floor_from_pixels[2], 0.0)).any():
            return None  # beyond the horizon, where a rolled camera may see, the factor is not above 0
        return seen

    def find_places(self, depths: Floats) -> tuple[NDArray[np.float32], Floats]:
        """Where (rows, columns, 2) in the earlier picture what is so many times as far away as the floor was, and how
        far (rows, columns) it was from the camera, along the floor; NaN for what was behind it.
        """
        at_eye, on_floor = self._find_plane(0.0), self._find_plane(1.0)
        pixels = cv2.convertPointsToHomogeneous(_list_pixels(*self.grid.shape).reshape(-1, 2))[:, 0]
        depth = depths.reshape(-1, 1)
        seen = pixels @ at_eye.T + depth * (pixels @ (on_floor - at_eye).T)
        with np.errstate(divide="ignore", invalid="ignore"):
            places = np.where(seen[:, 2:] > 0.0, seen[:, :2] / seen[:, 2:], np.nan)
        eye = self.grid.eye_robot
        points = eye + depths[..., None] * (self.grid.points_robot - eye)
        away = np.linalg.norm(self.earlier_from_now.apply(points.reshape(-1, 2)) - eye, axis=1)
        return places.reshape(*depths.shape, 2).astype(np.float32), away.reshape(depths.shape)

    def _find_plane(self, depth: float) -> Floats:
        then, camera = self.earlier_from_now, self.mount.camera_from_robot
        c, s = math.cos(then.heading_rad), math.sin(then.heading_rad)
        turn = np.array([[c, -s], [s, c]])
        height_m = self.mount.height_m - self.grid.camera_height_m * depth
        moved = turn @ self.grid.eye_robot * (1.0 - depth) + then.position
        there = np.column_stack([depth * camera.rotation[:, :2] @ turn,
                                 camera.rotation @ np.append(moved, height_m) + camera.translation])
        seen = there @ self.grid.floor_from_pixels
        lens = self.camera.matrix
        lens[:2] /= STEP_PX
        lens[:2, 2] += 0.5 / STEP_PX - 0.5
        return np.asarray(lens @ seen)


class Modelled(NamedTuple):
    """What the model has in the pixels of two pictures, all (rows, columns), away along the floor [m].

    Attributes:
        ranges_m: how far it is, floor or not; standing_m: how far the nearest is at least that is no floor; infinite
            without any.
        standing_then_m: the same as ``standing_m``, of the earlier picture.
    """

    ranges_m: NDArray[np.float32]
    standing_m: NDArray[np.float32]
    standing_then_m: NDArray[np.float32]

    def was_hidden(self, both: TwoPictures) -> NDArray[np.bool_]:
        """What the earlier picture does not show: something else of the model was before it, or it was outside that."""
        places, away_m = both.find_places(np.minimum(self.ranges_m / both.grid.ranges_m, 1.0))
        rows, columns = self.standing_then_m.shape
        x, y = np.moveaxis(np.nan_to_num(np.rint(places), nan=-1.0), -1, 0).astype(int)
        y = y - both.grid.top
        is_in = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
        before_m = self.standing_then_m[np.clip(y, 0, rows - 1), np.clip(x, 0, columns - 1)]
        return np.asarray(~is_in | (before_m < away_m - MAX_HIDING_M))


@dataclass(frozen=True, eq=False)
class Relief:
    """What an earlier picture tells of the pixels of a grid.

    Attributes:
        kinds: (rows, columns) UNCONFIRMED, FLAT (on the floor, or mirrored in it, or of the model), or STANDING.
        parts: (rows, columns) how far what stands is, as a part of the distance of the floor that it hides; above 1
            what is mirrored in the floor; else 1.
        gains_px: (rows, columns) what is at a part p of that distance was ``gain * (1 / p - 1)`` from where the floor
            was in the earlier picture, reduced; 0 where that is not in it.
    """

    kinds: NDArray[np.uint8]
    parts: NDArray[np.float32]
    gains_px: NDArray[np.float32]

    def beside(self, model: NDArray[np.bool_]) -> Relief:
        """The same without what stands where a patch shows a part of the model (rows, columns) that is no floor."""
        near = cv2.dilate(model.astype(np.uint8), np.ones((REACH, REACH), np.uint8)) > 0
        kinds = np.where((self.kinds == STANDING) & near, UNCONFIRMED, self.kinds).astype(np.uint8)
        return replace(self, kinds=kinds)

    def agreeing(self, other: Relief | None, tested: NDArray[np.bool_]) -> Relief:
        """The same without what stands, where that is asked (rows, columns), unless another relief of the same picture
        tells it to stand about there and about as far away: by chance a texture is like itself. None: there is none.
        """
        if other is None:
            return replace(self, kinds=np.where((self.kinds == STANDING) & tested, UNCONFIRMED, self.kinds))
        around = np.ones((REACH - 2 * HALF + 2, REACH - 2 * HALF + 2), np.uint8)
        agreed = np.zeros(self.kinds.shape, bool)
        for near, part, far in zip((1.0, *PARTS), PARTS, (*PARTS[1:], 0.0), strict=False):
            there = (other.kinds == STANDING) & (other.parts <= np.float32(near)) & (other.parts >= np.float32(far))
            agreed |= (self.parts == np.float32(part)) & (cv2.dilate(there.astype(np.uint8), around) > 0)
        return replace(self, kinds=np.where((self.kinds == STANDING) & tested & ~agreed, UNCONFIRMED, self.kinds))

    def tells_of(self, parts: Floats) -> NDArray[np.bool_]:
        """Where what is at such parts (rows, columns) of the distance is told from the floor, if there is texture; and
        from what is mirrored in it, where that is seen.
        """
        lying = np.maximum(self.parts, 1.0)
        return np.asarray(self.gains_px * (1.0 / np.maximum(parts, 1e-3) - 1.0 / lying) >= MIN_APART_PX)


def find_relief(
    both: TwoPictures, is_floor: NDArray[np.bool_], sigma_m: float = 0.0, sigma_rad: float = 0.0,
    modelled: Modelled | None = None,
) -> Relief | None:
    """The relief of a picture; None where the earlier one looked the other way, or the motion between is not known.

    Args:
        is_floor: (rows, columns) where the floor is most likely: by it the two are aligned.
        sigma_m, sigma_rad: standard deviations of the motion between the two.
        modelled: by it what stands is distinguished from what of the model stands there; without, all of it stands.
    """
    aligned = _align(both, is_floor, np.array([sigma_m, sigma_m, sigma_rad]))
    if aligned is None:
        return None
    both, floor, nearer = aligned, aligned.find_map(1.0), aligned.find_map(PARTS[1])
    if floor is None or nearer is None:
        return None
    sweep = _Sweep(both.picture[both.grid.top:], both.earlier)
    flat = sweep.place(floor)
    away = sweep.place(nearer) - flat
    apart = np.maximum(np.abs(away[..., 0]), np.abs(away[..., 1]))  # faster than along an axis
    gains = np.where(sweep.is_in(flat), apart / (1.0 / PARTS[1] - 1.0), 0.0).astype(np.float32)
    lying = reduce(np.maximum, (sweep.compare(_shifted(floor, near)) for near in np.array(NEAR_SHIFTS)))
    standing, parts = np.full(sweep.shape, -1.0, np.float32), np.ones(sweep.shape, np.float32)
    on_floor, depths = lying, np.ones(sweep.shape, np.float32)
    for depth in (*PARTS, *DEPTHS):
        too_near = gains * abs(1.0 / depth - 1.0) < MIN_APART_PX
        plane = None if too_near.all() else both.find_map(depth)
        if plane is None:
            continue
        likeness = sweep.compare(plane)
        likeness[too_near] = -1.0
        if depth > 1.0:
            depths[likeness > lying] = depth
            lying = np.maximum(lying, likeness)
        else:
            if modelled is not None:
                is_modelled = depth * both.grid.ranges_m >= modelled.standing_m - MODEL_GAP_M
                lying = np.where(is_modelled, np.maximum(lying, likeness), lying)
                likeness[is_modelled] = -1.0
            is_best = likeness > standing
            standing[is_best], parts[is_best] = likeness[is_best], depth
    tested = sweep.tells & is_floor & (lying > -1.0)
    agreeing, least = np.count_nonzero(lying[tested] >= MIN_LIKENESS), MIN_AGREEING * np.count_nonzero(tested)
    if modelled is not None:  # things are not known by their looks, and may fill most of the picture
        stands = (standing >= MIN_LIKENESS) & (standing - lying >= MIN_LEAD)
        least = max(MIN_AGREEING * np.count_nonzero(tested & ~stands), MIN_BESIDE_THINGS * np.count_nonzero(tested))
    if agreeing < least:
        return None
    kinds = np.zeros(sweep.shape, np.uint8)
    for kind, own, other in ((FLAT, lying, standing), (STANDING, standing, lying)):
        kinds[sweep.tells & (own >= MIN_LIKENESS) & (own - other >= MIN_LEAD)] = kind
    kinds[(kinds == STANDING) & (sweep.measure_texture_along(away) < MIN_ALONG)] = UNCONFIRMED
    if modelled is not None:
        kinds[(kinds == STANDING) & modelled.was_hidden(both)] = UNCONFIRMED
    is_mirrored = (kinds == FLAT) & (lying - on_floor >= MIN_LEAD)
    parts = np.where(kinds == STANDING, parts, np.where(is_mirrored, depths, np.float32(1.0)))
    return Relief(kinds, parts, gains)


def _align(both: TwoPictures, is_floor: NDArray[np.bool_], sigmas: Floats) -> TwoPictures | None:
    """The same with the motion between the pictures by which most of the floor agrees, near the one that is believed.

    None where that leaves the motion too unsure. Gauss-Newton on the contrast of both pictures at half their size, with
    the weights of Geman and McClure.

    Args:
        sigmas: (3,) of the motion [m, m, rad].
    """
    now, earlier = (np.asarray(cv2.pyrDown(grey), np.float32) for grey in (both.picture[both.grid.top:], both.earlier))
    sweep = _Sweep(now, earlier)
    tested = sweep.tells & is_floor[::2, ::2]
    contrast = _measure_contrast(now, _blur(now))[tested]

    def see(change: Floats) -> Floats:
        """The contrast of the earlier picture where it is asked, if the motion was different; NaN outside it."""
        floor = both._replace(earlier_from_now=_changed(both.earlier_from_now, change)).find_map(1.0)
        if floor is None:
            return np.full(len(contrast), np.nan)
        seen = sweep.warp(np.diag([0.5, 0.5, 1.0]) @ floor @ np.diag([2.0, 2.0, 1.0]))
        mean = _blur(seen)
        return np.where(mean[tested] < 0.0, np.nan, _measure_contrast(seen, mean)[tested])

    change, prior = np.zeros(3), np.diag(1.0 / np.square(np.maximum(sigmas, LEAST_SIGMAS)))
    information = prior
    for _ in range(ALIGN_ROUNDS if tested.any() else 0):
        base, *others = (see(change + step) for step in (np.zeros(3), *np.diag(ALIGN_STEPS)))
        slopes = np.stack([(other - base) / step for other, step in zip(others, ALIGN_STEPS, strict=True)], axis=1)
        seen = np.isfinite(slopes).all(axis=1)
        slopes, off = slopes[seen], contrast[seen] - base[seen]
        weights = (1.0 + (off / CONTRAST_SIGMA) ** 2) ** -2 / CONTRAST_SIGMA**2 / PATCH
        information = slopes.T @ (weights[:, None] * slopes) + prior
        step = np.linalg.solve(information, slopes.T @ (weights * off) - prior @ change)
        change = change + step
        if step @ information @ step < MAX_LEFT_SIGMAS**2:
            break
    left = np.sqrt(np.diag(np.linalg.inv(information)))
    if both.camera.fx / STEP_PX * (left[2] + left[1] / TYPICAL_M) > MAX_UNSURE_PX:
        return None
    return both._replace(earlier_from_now=_changed(both.earlier_from_now, change))


def _measure_contrast(grey: Grey, mean: Grey) -> Grey:
    """Grey levels less their mean round each, in standard deviations round it."""
    return np.asarray((grey - mean) / np.maximum(_measure_deviation(grey, mean), MIN_DEVIATION), np.float32)


def _measure_deviation(grey: Grey, mean: Grey) -> Grey:
    """The standard deviation round each pixel; in place, as it is asked thirty times a picture."""
    square = _blur(grey * grey)
    square -= mean * mean
    return np.asarray(np.sqrt(np.maximum(square, 0.0, out=square), out=square))


def _changed(motion: Pose2, by: Floats) -> Pose2:
    return Pose2(motion.x_m + by[0], motion.y_m + by[1], motion.heading_rad + by[2])


def _shifted(plane: Floats, by: Floats) -> Floats:
    return np.asarray(np.array([[1.0, 0.0, by[0]], [0.0, 1.0, by[1]], [0.0, 0.0, 1.0]]) @ plane)


class _Sweep:
    """Compares the patches of a picture with those of an earlier one, seen through planes."""

    def __init__(self, now: Grey, earlier: Grey) -> None:
        self._now, self._earlier = now, earlier
        self.shape = now.shape
        self._mean = _blur(now)
        self._deviation = _measure_deviation(now, self._mean)
        self.tells = self._deviation >= MIN_DEVIATION

    def place(self, plane: Floats) -> NDArray[np.float32]:
        """(rows, columns, 2) where the pixels were in the earlier picture."""
        return np.asarray(cv2.perspectiveTransform(_list_pixels(*self.shape), plane))

    def is_in(self, places: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Which places are in the earlier picture, with their patches."""
        rows, columns = self._earlier.shape
        x, y = places[..., 0], places[..., 1]
        return np.asarray((x >= HALF) & (x <= columns - 1 - HALF) & (y >= HALF) & (y <= rows - 1 - HALF))

    def measure_texture_along(self, directions: NDArray[np.float32]) -> NDArray[np.float32]:
        """(rows, columns) share of the squared gradients of patches that is along directions (rows, columns, 2)."""
        x, y = (cv2.Sobel(self._now, cv2.CV_32F, *order, ksize=3) for order in ((1, 0), (0, 1)))
        xx, xy, yy = (_blur(product) for product in (x * x, x * y, y * y))
        u, v = directions[..., 0], directions[..., 1]
        along = xx * u * u + 2.0 * xy * u * v + yy * v * v
        return np.asarray(along / np.maximum((xx + yy) * (u * u + v * v), 1e-9))

    def warp(self, plane: Floats) -> Grey:
        """(rows, columns) the earlier picture through a plane."""
        rows, columns = self.shape
        return np.asarray(cv2.warpPerspective(
            self._earlier, plane, (columns, rows), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_CONSTANT, borderValue=OUTSIDE), np.float32)

    def compare(self, plane: Floats) -> Grey:
        """(rows, columns) normalized correlation of patches; -1 where they are not in the earlier picture."""
        seen = self.warp(plane)
        mean = _blur(seen)
        deviation = _measure_deviation(seen, mean)
        deviation *= self._deviation
        likeness = _blur(self._now * seen)
        likeness -= self._mean * mean
        likeness /= np.maximum(deviation, 1.0, out=deviation)
        likeness[mean < 0.0] = -1.0
        return likeness


@lru_cache(maxsize=4)
def _list_pixels(rows: int, columns: int) -> NDArray[np.float32]:
    """(rows, columns, 2) column and row of each pixel."""
    return np.stack(np.meshgrid(np.arange(columns, dtype=np.float32), np.arange(rows, dtype=np.float32)), axis=-1)


def _blur(values: NDArray[Any]) -> Grey:
    return np.asarray(cv2.boxFilter(values, cv2.CV_32F, (2 * HALF + 1, 2 * HALF + 1), borderType=cv2.BORDER_REFLECT))
