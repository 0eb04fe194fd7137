"""How far the floor is free, by one picture: what does not look like floor where the model has floor ends it (§4)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.arrays import Floats, Ints
from knowledge_sources.methods.features import compute_mean_and_deviation, is_dark, read_picture
from knowledge_sources.methods.floor.appearance import (
    MAX_CHROMA_ERROR,
    compute_appearance,
    default_covariance,
    find_floor_in_shade,
    fit_appearance,
)
from knowledge_sources.methods.floor.looks_round import MAX_HIDDEN_M
from knowledge_sources.methods.floor.model_floor import (
    SIGHT_M,
    STEP_PX,
    FloorGrid,
    ModelFloor,
    build_floor_grid,
    predict_model_floor,
)
from knowledge_sources.methods.floor.relief import STANDING, Modelled, Relief, TwoPictures, find_relief
from knowledge_sources.methods.floor.standing_regions import (
    StandingRegion,
    compute_parallax_odds,
    drop_specks,
    find_footprint,
    find_regions,
    measure_height,
)
from knowledge_sources.settings import DEFAULT, FloorSettings, Settings
from world_models.entries import FloorEnd, FloorThing, FreeFloor, Light
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

FLOOR_VIEW_DISTANCE_M = 0.25
"""A picture is kept to compare later ones with when the robot has gone so far since the last."""
FLOOR_VIEW_TURN_RAD = math.radians(30.0)
"""Or has turned so far."""
MAX_TURNED_RAD = math.radians(45.0)
"""Pictures are compared if the robot turned no further between them: further aside hardly any floor is in both."""

BEARINGS = 64  # directions in which the free floor of a picture is written down
MAX_ROLLED_OVER_M = 0.05  # what is not higher than this is rolled over
MIN_FLOOR_SHARE = 0.3
"""Share of what should be floor that must agree with its known looks; else the picture may be tinted."""
MIN_TINTED_SHARE = 0.6  # share of what should be floor that must look alike, to be the floor in a tinted picture
MAX_TINT = 0.12  # largest difference from the floor's colour, in its parts of red and blue, in a tinted picture
MODEL_MARGIN_PX = 3.0  # pixels so near to an edge of the model tell nothing; the belief's uncertainty comes on top
P_SEEN_ONCE = 0.7  # probability that what does not look like the floor stands on it, before parallax tells
MAX_P_SEEN_ONCE = 0.95  # no picture alone makes a thing more certain, whatever it shows
P_LIKE_FLOOR = 0.015  # the same of what looks like the floor, and seems to stand up from it
MIN_UNLIKE_SHARE = 0.2  # of a region of which less than that does not look like the floor, all is said to look like it
CONFIRMED_HEIGHT_M = 0.3  # what looks like the floor is confirmed where something so high would be seen
DOUBT_MARGIN_M = 0.15  # floor so near to what stands by one earlier picture alone is not seen to be free
MIN_DOUBTFUL_ROWS = 10  # of a column of the picture at half its size, from which that is so
PART_SIGMA = 0.05  # of the part of the floor's distance at which the earlier picture shows a thing

CUT_SIGMA_M = 0.15
"""Of a foot that the picture's lower border cuts off: it is anywhere between where that starts and the robot's rim."""
GREY = np.array([0.299, 0.587, 0.114], np.float32)
SIGHT_PART = 2.0
"""Pixels are looked at up to so many times the sight, for the tops of things."""


class MotionBetween(NamedTuple):
    """Where the robot came to, in its frame before, with standard deviations."""

    moved: Pose2
    sigma_m: float
    sigma_rad: float


class Seen(NamedTuple):
    """A picture, the robot's pose [world] when it was taken, and its motion since."""

    jpeg: bytes
    pose: Pose2
    since: MotionBetween


def see_free_floor(
    robot: RobotModel,
    locale: str,
    pose: Pose2,
    covariance: Floats,
    jpeg: bytes,
    earlier: Sequence[Seen],
    seen_s: float,
    settings: Settings = DEFAULT,
    last_light: Light | None = None,
) -> FreeFloor:
    """How far the floor is free in each direction, and what ends it.

    Args:
        robot: on the floor of the locale.
        pose, covariance: of the robot and (3, 3) of (x, y, heading), world.
        jpeg: the picture as the lens made it.
        earlier: pictures from before, the newest first: for parallax.
        seen_s: when it was taken.
        last_light: that of a picture shortly before; None: of none.

    Raises:
        ValueError: it is not a picture.
    """
    s = settings.floor
    floor_m = robot.world.floor_m(locale)
    height_m = robot.mount.height_m - floor_m
    grid = build_floor_grid(robot.camera, robot.mount, height_m, SIGHT_PART * SIGHT_M)
    eye = pose @ Pose2(robot.mount.forward_m, 0.0, 0.0)
    shown = read_picture(jpeg)
    if grid is None or is_dark(*compute_mean_and_deviation(shown.grey)):
        return FreeFloor("camera", locale, eye.x_m, eye.y_m, (), (), (), (), (), (), seen_s)
    sigma_rad = math.sqrt(max(float(covariance[2, 2]), 0.0))
    margin_px = MODEL_MARGIN_PX + 2.0 * sigma_rad * robot.camera.fx
    sigma_m = math.sqrt(max(float(np.trace(covariance[:2, :2])) / 2.0, 0.0))
    model = predict_model_floor(
        robot, pose, grid, floor_m, MAX_ROLLED_OVER_M, margin_px, 2.0 * sigma_m * robot.camera.fx)
    picture = shown.rectified_half(robot.lens, robot.camera)
    if robot.camera.obstruction is not None:  # its looks are those of no floor
        model = model.behind(robot.camera.obstruction.covers(grid.pixels, MODEL_MARGIN_PX))
    unlike, tells, light = find_unlike(picture[grid.top:], model, last_light)
    unlike &= s.use_appearance
    alike = [seen for seen in earlier if abs(wrap_angle(seen.since.moved.heading_rad)) <= MAX_TURNED_RAD]
    compare = cache(lambda k: _compare(alike[k], robot, grid, model, unlike, picture, floor_m))
    relief = compare(0) if s.use_parallax and alike else None
    tested = tells
    if relief is not None and model.is_unknown.any():  # the motion alone tells what stands there
        by_motion = model.is_unknown | ~model.is_plain
        elsewhere = [k for k, seen in enumerate(alike) if seen.pose.distance_to(alike[0].pose) >= FLOOR_VIEW_DISTANCE_M]
        again = compare(elsewhere[0]) if elsewhere and (by_motion & (relief.kinds == STANDING)).any() else None
        confirmed = model.is_unknown & relief.tells_of(np.full(grid.shape, _find_confirmed_part(grid)))
        sure = relief.agreeing(again, by_motion)
        doubtful = drop_specks((relief.kinds == STANDING) & (sure.kinds != STANDING))
        confirmed &= grid.ranges_m < _keep_off(np.where(doubtful, relief.parts * grid.ranges_m, np.inf), robot)
        relief = sure
        tested, tells = tells | by_motion, tells | confirmed
    regions = find_regions(unlike, tested, grid, relief)
    reliefs = [] if relief is None else [relief]
    if reliefs and len(alike) > 1 and any(not (region.mask & unlike).any() for region in regions):
        again = compare(1)  # what looks like the floor is compared with one more picture
        reliefs += [] if again is None else [again]
    built = [(region, _build_thing(region, grid, robot, pose, covariance, reliefs, unlike, s)) for region in regions]
    things = [(region, thing) for region, thing in built if thing is not None]
    scan = _scan(grid, model, tells, things, robot.camera.fy, s)
    return FreeFloor(
        sense="camera", locale=locale, x_m=round(eye.x_m, 4), y_m=round(eye.y_m, 4),
        bearings_rad=tuple(round(math.remainder(pose.heading_rad + b, math.tau), 5) for b in scan.bearings_rad),
        near_m=scan.near_m, far_m=scan.far_m, ends=scan.ends, sigma_m=scan.sigma_m,
        things=tuple(thing for _, thing in things), seen_s=seen_s, light=light,
        confirmed_m=_measure_confirmed_m(grid, relief))


def _keep_off(doubtful_m: Floats, robot: RobotModel) -> Floats:
    """(columns,) how far the floor is free next to what may stand at these distances (rows, columns).

    Next to what is high: a speck, as tiles give some, hides nothing next to it.
    """
    nearest_m, high = doubtful_m.min(axis=0), np.count_nonzero(np.isfinite(doubtful_m), axis=0) >= MIN_DOUBTFUL_ROWS
    free_m = nearest_m.copy()
    for column in np.flatnonzero(high):
        wide = math.ceil(DOUBT_MARGIN_M * robot.camera.fx / STEP_PX / nearest_m[column])
        beside = slice(max(0, column - wide), column + wide + 1)
        free_m[beside] = np.minimum(free_m[beside], nearest_m[column])
    return np.asarray(free_m)


def _compare(
    then: Seen, robot: RobotModel, grid: FloorGrid, model: ModelFloor, unlike: NDArray[np.bool_],
    picture: NDArray[np.uint8], floor_m: float,
) -> Relief | None:
    """The relief of a picture by an earlier one."""
    before = read_picture(then.jpeg).rectified_half(robot.lens, robot.camera)
    now, earlier = (np.asarray(image.astype(np.float32) @ GREY, np.float32) for image in (picture, before))
    both = TwoPictures(grid, now, earlier, then.since.moved, robot.camera, robot.mount)
    modelled = None
    if model.is_unknown.any():
        old = predict_model_floor(robot, then.pose, grid, floor_m, MAX_ROLLED_OVER_M, MODEL_MARGIN_PX)
        modelled = Modelled(model.ranges_m, model.standing_m, old.standing_m)
    relief = find_relief(both, model.is_plain & ~unlike, then.since.sigma_m, then.since.sigma_rad, modelled)
    return relief if relief is None or modelled is not None else relief.beside(~model.is_plain)


def find_unlike(
    picture: NDArray[np.uint8], model: ModelFloor, last_light: Light | None = None
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], Light | None]:
    """Which pixels (rows, columns) do not look like the floor that the model has there, where that tells anything, and
    the light of the picture; None where it is not known.

    The floor with most pixels tells how bright the picture is; a floor of which little is seen is compared by that.
    """
    appearance = compute_appearance(cv2.GaussianBlur(np.asarray(picture), (3, 3), 0.6).astype(np.float32))
    unlike, tells = np.zeros(model.kinds.shape, bool), np.zeros(model.kinds.shape, bool)
    light: Light | None = None
    shift: Floats | None = None  # of this picture's looks from the model's: its exposure, and a tint where it has one
    kinds, counts = np.unique(model.kinds[model.is_plain], return_counts=True)
    for kind in kinds[np.argsort(-counts, kind="stable")]:
        if np.isnan(model.colours[kind]).any():
            continue
        here = model.is_plain & (model.kinds == kind)
        by_model = compute_appearance(255.0 * model.colours[kind])
        if shift is None:
            fitted = _fit_most(appearance, here, by_model, last_light)
            if fitted is None:
                continue
            mean, floor = fitted
            shift = mean - by_model
            light = (float(shift[0]), float(shift[1]), float(shift[2]))
            if np.abs(shift[1:]).max() <= MAX_CHROMA_ERROR:
                shift[1:] = 0.0
        else:
            expected = by_model + shift
            mean, covariance = fit_appearance(appearance[here], expected, True) or (
                expected, 4.0 * default_covariance())
            floor = find_floor_in_shade(appearance, here, mean, covariance)
        unlike |= here & ~floor
        tells |= here
    return unlike, tells, light


def _fit_most(
    appearance: Floats, here: NDArray[np.bool_], by_model: Floats, last_light: Light | None
) -> tuple[Floats, NDArray[np.bool_]] | None:
    """Mean of the looks of the floor ``here`` and which pixels look like it, in the light of the last picture or in any
    other; None where none is known.

    Where hardly any of it agrees, the camera's white balance may differ from the model's: what most of it looks like
    then is the floor, if it has about the floor's hue. That is so only where no picture was taken shortly before: white
    balance follows the light little by little, and what fills the picture all at once is a thing.
    """
    seen, size = appearance[here], np.count_nonzero(here)
    expected = by_model if last_light is None else by_model + last_light
    guesses = [(False, MAX_CHROMA_ERROR, MIN_FLOOR_SHARE)]
    guesses = [*guesses, (False, MAX_TINT, MIN_TINTED_SHARE)] if last_light is None else [
        (True, MAX_CHROMA_ERROR, MIN_FLOOR_SHARE), *guesses]
    first: tuple[Floats, NDArray[np.bool_]] | None = None
    for is_lit, limit, share in guesses:
        fit = fit_appearance(seen, expected, is_lit, limit)
        found = None if fit is None else (fit[0], find_floor_in_shade(appearance, here, *fit))
        if found is not None and np.count_nonzero(found[1]) >= share * size:
            return found
        first = first or (found if limit == MAX_CHROMA_ERROR else None)
    return first


FLOOR_ENDS: tuple[FloorEnd, ...] = ("thing", "sight", "model")
THING, SIGHT, MODEL = range(3)


class _Scan(NamedTuple):
    bearings_rad: tuple[float, ...]
    near_m: tuple[float, ...]
    far_m: tuple[float, ...]
    ends: tuple[FloorEnd, ...]
    sigma_m: tuple[float, ...]


def _scan(
    grid: FloorGrid, model: ModelFloor, tells: NDArray[np.bool_], things: Sequence[tuple[StandingRegion, FloorThing]],
    fy: float, settings: FloorSettings,
) -> _Scan:
    """From the lower border up: as far as the model has floor, its looks are known, and no thing is in the way."""
    rows, columns = grid.shape
    thing_m = np.full(columns, np.inf)  # how far what ends the floor is, in each column
    for region, thing in things:
        if thing.p_thing >= 0.5:
            lowest = rows - 1 - np.argmax(region.mask[::-1], axis=0)
            own_m = np.where(region.mask.any(axis=0), grid.ranges_m[lowest, np.arange(columns)], np.inf)
            at = region.feet[:, 1]
            own_m[at] = np.minimum(own_m[at], grid.ranges_m[region.feet[:, 0], at] * region.parts)
            thing_m = np.minimum(thing_m, own_m)
    ends, groups = (model.kinds < 0)[::-1], _Groups(columns)
    stop = groups.least(np.where(ends.any(axis=0), np.argmax(ends, axis=0), rows))
    lowest_m = grid.ranges_m[-1]
    near_m = groups.most(lowest_m) * max(0.0, 1.0 - MAX_HIDDEN_M / grid.camera_height_m)
    column_of = np.arange(columns)

    def find_range_m(rows_up: Ints) -> Floats:
        """The least distance of the pixels of each group in its own row, counted from below."""
        return groups.least(grid.ranges_m[rows - 1 - groups.spread(rows_up), column_of])

    range_m = np.where(stop >= rows, SIGHT_M, find_range_m(np.minimum(stop, rows - 1)))
    confirmed = groups.any(tells[::-1]) & (np.arange(rows)[:, None] < np.maximum(stop, 1))
    is_confirmed, last_confirmed = confirmed.any(axis=0), rows - 1 - np.argmax(confirmed[::-1], axis=0)
    # Next to the model's own parts the looks tell nothing, and something may stand there.
    range_m = np.where(is_confirmed, np.minimum(range_m, find_range_m(last_confirmed) + settings.max_untold_m), range_m)
    at_thing_m = groups.least(thing_m)
    is_thing, is_sight = at_thing_m <= np.minimum(range_m, SIGHT_M), range_m >= SIGHT_M
    range_m = np.minimum(range_m, at_thing_m)
    is_blind = (stop == 0) | ~is_confirmed  # nothing of the floor is seen, or its looks are not known
    range_m[is_blind | (at_thing_m <= groups.least(lowest_m))] = 0.0
    sigma_m = 0.01 + STEP_PX * range_m**2 / (grid.camera_height_m * fy)
    kinds = np.where(is_blind & (stop != 0), SIGHT, np.where(is_thing, THING, np.where(is_sight, SIGHT, MODEL)))
    return _Scan(groups.mean(grid.bearings_rad), _round(near_m), _round(np.minimum(range_m, SIGHT_M)),
                 tuple(FLOOR_ENDS[kind] for kind in kinds), _round(sigma_m))


class _Groups:
    """Neighbouring columns of a picture that give one direction; bearings grow to the left."""

    def __init__(self, columns: int) -> None:
        each, more = divmod(columns, BEARINGS)
        self._sizes = np.repeat([each + 1, each], [more, BEARINGS - more])
        self._starts = np.cumsum(self._sizes) - self._sizes

    def least(self, values: NDArray[Any]) -> NDArray[Any]:
        """(n,) of (columns,)."""
        return np.minimum.reduceat(values[::-1], self._starts)

    def most(self, values: NDArray[Any]) -> NDArray[Any]:
        """(n,) of (columns,)."""
        return np.maximum.reduceat(values[::-1], self._starts)

    def any(self, mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(rows, n) of (rows, columns)."""
        return np.logical_or.reduceat(mask[:, ::-1], self._starts, axis=1)

    def mean(self, values: Floats) -> tuple[float, ...]:
        """(n,) of (columns,)."""
        return tuple((np.add.reduceat(values[::-1], self._starts) / self._sizes).tolist())

    def spread(self, values: NDArray[Any]) -> NDArray[Any]:
        """(columns,) of (n,)."""
        return np.repeat(values, self._sizes)[::-1]


def _round(values: Floats) -> tuple[float, ...]:
    return tuple(round(value, 3) for value in values.tolist())


def _measure_confirmed_m(grid: FloorGrid, relief: Relief | None) -> tuple[float, ...]:
    """Up to where the earlier picture tells, in each direction, of something of that height."""
    if relief is None:
        return ()
    part = _find_confirmed_part(grid)
    tells_m = np.where(relief.tells_of(np.full(grid.shape, part)), part * grid.ranges_m, 0.0).max(axis=0)
    return _round(np.minimum(SIGHT_M, _Groups(grid.shape[1]).least(tells_m)))


def _find_confirmed_part(grid: FloorGrid) -> float:
    """How far what is CONFIRMED_HEIGHT_M high is, as a part of the distance of the floor that it hides."""
    return max(0.0, 1.0 - CONFIRMED_HEIGHT_M / grid.camera_height_m)


def _build_thing(
    region: StandingRegion, grid: FloorGrid, robot: RobotModel, pose: Pose2, covariance: Floats,
    reliefs: Sequence[Relief], unlike: NDArray[np.bool_], settings: FloorSettings,
) -> FloorThing | None:
    """What stands where a region is; None where it is lower than what is rolled over."""
    height_m, sigma_height_m = measure_height(region, grid)
    if height_m < MAX_ROLLED_OVER_M and math.isfinite(sigma_height_m):
        return None
    looks_like_floor = bool(
        np.count_nonzero(unlike & region.mask) < MIN_UNLIKE_SHARE * np.count_nonzero(region.mask))
    p_before = P_LIKE_FLOOR if looks_like_floor else P_SEEN_ONCE
    odds = p_before / (1.0 - p_before)
    how = "it looks like the floor" if looks_like_floor else "it does not look like the floor"
    if reliefs:
        tested = reliefs if looks_like_floor else reliefs[:1]
        parallax_odds = math.prod(compute_parallax_odds(region, relief, grid) for relief in tested)
        odds *= parallax_odds
        if parallax_odds != 1.0:
            stands = "stands up from it" if parallax_odds > 1.0 else "lies flat on it"
            how += f"{' and' if (parallax_odds > 1.0) != looks_like_floor else ', but'} {stands}"
    elif not settings.use_parallax:
        odds = 1e6
    corners = find_footprint(region, grid)
    world = pose.apply(corners)
    foot_m = float(np.linalg.norm(corners, axis=1).min())
    spread = math.sqrt(max(float(np.trace(covariance[:2, :2])) / 2.0, 0.0) + foot_m**2 * float(covariance[2, 2]))
    at, left_right = np.flatnonzero(region.mask.any(axis=1)), np.flatnonzero(region.mask.any(axis=0))
    (left, top), (right, bottom) = grid.pixels[at[0], left_right[0]], grid.pixels[at[-1], left_right[-1]]
    own = CUT_SIGMA_M if region.is_cut else STEP_PX * foot_m**2 / (grid.camera_height_m * robot.camera.fy)
    part, most_p = float(region.parts.min()), MAX_P_SEEN_ONCE
    if part < 1.0:  # one picture before tells how far it is: that may be another thing's place
        own, most_p = math.hypot(own, PART_SIGMA * foot_m / part), P_SEEN_ONCE
    return FloorThing(
        footprint=tuple((round(float(x), 3), round(float(y), 3)) for x, y in world),
        sigma_m=round(math.hypot(spread, own), 4),
        height_m=round(height_m, 3), sigma_height_m=round(sigma_height_m, 3),
        p_thing=min(most_p, round(odds / (1.0 + odds), 4)),
        box_px=(float(left), float(top), float(right), float(bottom)), evidence=how, is_cut=region.is_cut,
        is_camouflaged=looks_like_floor)
