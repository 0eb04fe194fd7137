"""Which place of a floor a lost robot is at: a search with each camera and building that may be, and what follows."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.localization.global_localization import (
    MAX_CANDIDATES,
    MAX_SEARCHED_VIEWS,
    MIN_VIEWS,
    REFUTING_LOG_RATIO,
    LocalizationResult,
    LocalizationStatus,
    PlaceCandidate,
    count_refined,
    decide,
    localize,
)
from knowledge_sources.methods.localization.next_view import (
    SensingAction,
    choose_far_action,
    make_view_predictor,
    normalize_log_likelihoods,
)
from knowledge_sources.methods.localization.place_odds import StatedPlace
from knowledge_sources.methods.localization.pose_candidates import DISTINCT, are_distinct
from knowledge_sources.methods.localization.refinement import list_pairs, refine_view_motions
from knowledge_sources.methods.localization.views import CameraView, align_headings
from knowledge_sources.methods.pose import Rests, compute_protection
from world_models.building.building import Building
from world_models.entries import PlaceOdds, Protection, count_sigmas
from world_models.frame_building import FrameBuilding
from world_models.frames import Pose2
from world_models.robot import RobotModel

MAX_FAR_PROBES = 20
"""So many looks are taken when lost and places fit: it turns, and drives to views that tell them apart."""
LEAST_P_SAID = 0.005  # least probability of none of these that is said
MAX_ROOMS = 80  # most rooms that are searched, the nearest to the last belief first
MAX_FLOOR_DIFFERENCE_M = 0.5  # rooms whose floors differ by less are on one floor


class Search(NamedTuple):
    """What is looked for.

    Attributes:
        looks: views since the robot is lost, without the occlusions of its lens.
        rooms: that are searched, the nearest to the last belief first.
        here: room and pose (world) of the last belief.
        followed: rooms and poses of the candidates of the last search, as the robot has moved since.
        touched: where something was touched, (2,) [m] in the robot's frame now.
        p_here: how likely it was there, before these looks.
    """

    looks: Sequence[CameraView]
    rooms: Sequence[str]
    here: tuple[str, Pose2]
    followed: Sequence[tuple[str, Pose2]]
    touched: Sequence[Floats] = ()
    p_here: float = 0.0


def search(robots: Iterable[RobotModel], what: Search) -> tuple[LocalizationResult, int]:
    """The result of the robot, camera and building, in which the best place fits best, and which it is.

    The floor is searched once, with the first robot; another one weighs the places that were found, and those that look
    like them. It searches by itself only where enough looks have found no place to believe. What two robots tell
    otherwise is not found.
    """
    asked = [*robots]
    results = [_localize(asked[0], what)]
    for robot in asked[1:]:
        found = [c for result in results for c in result.candidates]
        if any(c.is_accepted for c in found):
            places = [(c.room, c.world_from_robot) for c in found]
            results.append(_localize(robot, what._replace(followed=(*places, *what.followed)), is_searched=False))
        elif len(what.looks) >= MIN_VIEWS:
            results.append(_localize(robot, what))
    which = max(range(len(results)), key=lambda k: _measure_fit(results[k]))  # of equals the first
    best = results[which]
    rivals = _list_rivals(best, results)
    if best.status is LocalizationStatus.FOUND and rivals:
        both = (*best.candidates, *rivals)
        odds = normalize_log_likelihoods([c.likelihood.log_likelihood for c in both])
        weighed = [replace(c, weight=p * best.candidates[0].weight) for c, p in zip(both, odds, strict=True)]
        best = decide(asked[which], weighed, [look.now_from_then for look in what.looks], what.touched)
    return best, which


def _localize(robot: RobotModel, what: Search, *, is_searched: bool = True) -> LocalizationResult:
    return localize(robot, what.looks, what.rooms, what.here, what.followed, what.touched, what.p_here,
                    is_searched=is_searched)


def _list_rivals(best: LocalizationResult, results: Sequence[LocalizationResult]) -> list[PlaceCandidate]:
    """Other places that another camera or building explains so well that the best does not refute them, each once."""
    rivals: list[PlaceCandidate] = []
    for c in (c for result in results for c in result.candidates):
        is_near = _measure_fit(best) - c.likelihood.log_likelihood < REFUTING_LOG_RATIO
        if is_near and all(are_distinct(c.world_from_robot, o.world_from_robot) for o in (*best.candidates, *rivals)):
            rivals.append(c)
    return rivals


def _measure_fit(result: LocalizationResult) -> float:
    """The log likelihood of the best place."""
    return max((c.likelihood.log_likelihood for c in result.candidates), default=-math.inf)


def prefer_reachable(building: Building, result: LocalizationResult, locale: str) -> LocalizationResult:
    """Of places that nothing more can tell apart the only one to which wheels lead from where the robot was.

    Carried to another place of where it can drive to, it may look the same there: that stays ambiguous. But being
    carried through a wall or up the stairs, to a place that looks just like one within reach, is not believed.
    """
    near = [c for c in result.candidates if building.route(locale, c.room) is not None]
    if result.status is LocalizationStatus.FOUND or len(near) != 1 or not near[0].is_accepted:
        return result
    return LocalizationResult(LocalizationStatus.FOUND, (replace(near[0], weight=1.0),))


def find_odds_used(
    by_pictures: LocalizationResult, result: LocalizationResult, stated: StatedPlace, *, was_tracked: bool,
    refuted: int = 0,
) -> PlaceOdds | None:
    """The odds by which a place was found that the pictures alone had not found; None where they had."""
    if result.status is not LocalizationStatus.FOUND or by_pictures.status is LocalizationStatus.FOUND:
        return None
    found, count = result.candidates[0], len(by_pictures.candidates)
    return PlaceOdds(found.room, count, "tracked" if was_tracked else "stated", stated.p_prior, found.weight,
                     refuted)


def find_far_action(
    robot: RobotModel, result: LocalizationResult, looked: Sequence[Pose2], rooms: Sequence[str],
    touched: Sequence[Floats] = (),
) -> SensingAction | None:
    """The first leg of the way to a view that tells places apart that look alike from wherever the robot has looked.

    ``looked``: the poses of the looks, as seen from the present one.
    """
    looks = len(looked)
    is_stuck = result.status is LocalizationStatus.AMBIGUOUS or result.next_action is None
    accepted = sum(bool(c.is_accepted) for c in result.candidates)
    if result.status is LocalizationStatus.FOUND or accepted < 2 or looks >= MAX_FAR_PROBES:
        return None
    if looks < MIN_VIEWS or not (is_stuck or looks >= MAX_SEARCHED_VIEWS):
        return None
    hypotheses = [c.hypothesis for c in result.candidates]
    return choose_far_action(robot, hypotheses, looked, rooms, make_view_predictor(robot), touched)


def list_rooms(building: FrameBuilding, locale: str, here: Pose2) -> list[str]:
    """The rooms of a locale's floor, the nearest to a pose (world) first; other floors are not searched."""
    level_m = building.floor_m(locale)
    container = building.locale(locale).parent or locale
    rooms = _list_rooms_of_floor(building, container, level_m, MAX_FLOOR_DIFFERENCE_M)
    while len(rooms) < 2 and (above := building.locale(container).parent) is not None:  # as from an elevator's car
        container = above
        rooms = _list_rooms_of_floor(building, container, level_m, MAX_FLOOR_DIFFERENCE_M)
    away = [(_distance(building.outline(name), here), name) for name in rooms]
    return [name for _, name in sorted(away)[:MAX_ROOMS]]


def _list_rooms_of_floor(building: FrameBuilding, container: str, level_m: float, same_m: float) -> list[str]:
    rooms = building.list_rooms_in(container, level_m, same_m)
    building.require(rooms)
    return [name for name in rooms if abs(building.floor_m(name) - level_m) < same_m]


def _distance(outline: object, here: Pose2) -> float:
    """From a robot to the nearest corner of a room [m]: good enough for an order."""
    corners = np.asarray(outline, float)
    return float(np.min(np.hypot(corners[:, 0] - here.x_m, corners[:, 1] - here.y_m)))


def describe(result: LocalizationResult, *, is_far: bool, looks: int = 0) -> str:
    """What a search came to, in words; ``is_far``: the next action is on the way to a view that tells.

    ``looks``: so many that a search may have come to the bound of its work.
    """
    if (refined := count_refined(looks)) < MAX_CANDIDATES and result.status is not LocalizationStatus.FOUND:
        return f"{describe(result, is_far=is_far)}; by so many looks only the best {refined} places are weighed"
    places = " or ".join(f"{c.room} ({c.weight:.0%})" for c in result.candidates)
    p_none = 1.0 - math.fsum(c.weight for c in result.candidates)
    if places and p_none >= LEAST_P_SAID:
        places += f" or none of these ({p_none:.0%})"
    if result.status is LocalizationStatus.FOUND:
        return f"it is {places}, which stands alone"
    if result.status is LocalizationStatus.AMBIGUOUS:
        return f"ambiguous: {places}, which look alike from wherever could be looked"
    if result.next_action is None:
        return f"perhaps {places}; nothing new could be seen from here"
    move = f" and a move of {result.next_action.move_m:.1f} m" if result.next_action.move_m else ""
    probe = f"a turn by {math.degrees(result.next_action.turn_rad):.0f} degrees{move}"
    if is_far:
        return f"perhaps {places}, which look alike from here; on the way to a view that tells: {probe}"
    return f"perhaps {places}; {probe} tells most" if places else f"no place bears it out; {probe} shows something new"


def protect_place(
    robot: RobotModel, looks: Sequence[CameraView], pose: Pose2, covariance: Floats, camera_covariance: Floats,
    model_m: float = 0.0,
) -> Protection:
    """The protection level of a place (world) with its covariance (3, 3), by all lines that agree, in all looks.

    Nothing was believed before of a robot that is lost: where a line is left out, and no other tells, its place is
    known no better than candidates are apart. Motions between the looks are taken as they were refined with the place.
    ``camera_covariance``: (7, 7) of what is believed of the camera. ``model_m``: deviation of the model.
    """
    views = refine_view_motions(robot, align_headings(looks, robot.camera, robot.mount.camera_from_robot), pose,
                                covariance)
    lines, segments, names, seen_from = list[Floats](), list[Floats](), list[str](), list[Pose2]()
    for view in views:
        found = list_pairs(robot, view, view.pose_then(pose))
        lines.append(found.lines_world)
        segments.append(found.segments_px)
        names += found.names
        seen_from += [view.pose_then(pose)] * len(found.names)
    (apart_m, apart_rad), sigmas = DISTINCT, 2.0 * count_sigmas(1)  # where something is false, twice is taken
    nothing = np.diag(np.square(np.array([apart_m, apart_m, apart_rad]) / sigmas))
    return compute_protection(pose, covariance, Rests(
        np.concatenate(lines), np.concatenate(segments), names, robot.camera, robot.mount,
        np.zeros(len(camera_covariance)), pose, nothing, nothing, camera_covariance, seen_from, model_m))
