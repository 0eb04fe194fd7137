"""Relocalizer (§2, §4): goal-level perceptual servoing: finds a lost robot, and sets a new goal from there."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from blackboard.board import View
from blackboard.change import Change, Posted, Revised, Watch
from blackboard.effect import Effect, Post, Retract, Revise, to_say
from blackboard.entry import Entry
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from knowledge_sources.camera_knowledge import find_camera
from knowledge_sources.methods.localization.global_localization import (
    LocalizationResult,
    LocalizationStatus,
    PlaceCandidate,
    localize,
    make_alias_test,
)
from knowledge_sources.methods.localization.next_view import SensingAction, choose_far_action, make_view_predictor
from knowledge_sources.methods.localization.place_odds import StatedPlace, compute_prior, weigh_told
from knowledge_sources.methods.localization.views import CameraView, propagate_pose, update_obstruction
from knowledge_sources.questions import (
    active_goal,
    find_belief,
    find_building,
    find_building_as_filed,
    find_robot,
    is_over,
    is_standing,
    open_discrepancy,
)
from knowledge_sources.robot_knowledge_source import OlderSource
from knowledge_sources.settings import LocalizationSettings
from world_models.actuator import ActuatorModel
from world_models.building.building import Building
from world_models.entries.body import MotionReport, MotorCommand, PictureRequest
from world_models.entries.location import Hypothesis, HypothesisStatus, Place, PlaceOdds, TwinOdds, covariance_tuple
from world_models.entries.obstacle import Obstruction
from world_models.entries.percepts import Glimpse, Panorama, Segments
from world_models.entries.robot_state import CameraState
from world_models.entries.task import Certificate, Goal, PlanSketch
from world_models.frame_building import FrameBuilding
from world_models.frames import Pose2
from world_models.robot import RobotModel

MAX_PROBES = 8  # so many looks are taken when lost and no place fits; then the robot says that it does not know
MAX_DARK_FRAMES = 150  # so many dark frames are taken while waiting for light


class Relocalizer(OlderSource):
    """Keeps every place of the floor that agrees with its pictures, and takes more until one place is left.

    The next picture is taken after the turn or short safe move by which the candidates' views are expected to differ
    most; among places that look alike from here, the robot drives to a view that tells them apart, over floor that is
    free in all of them. Once the place is known, a new top-level goal leads from there to the old destination (§2). Of
    places that look alike, the one where it was told to be, or was tracked to, is believed if it is likely enough by
    these odds and by the pictures. Otherwise the robot stays lost and the candidates stay on the board: it never
    guesses. What is at the same place in its pictures while it turns is an obstruction, and is ignored.
    """

    level = Level.GOAL
    closes = Level.GOAL
    on = (
        Watch(Discrepancy, (Posted,), lambda d: d.is_open and d.level is Level.GOAL),
        Watch(Hypothesis, (Revised,), lambda h: h.is_held and h.basis == "odometry"),
        Watch(Segments, (Posted,), lambda s: s.milestone == ""),
    )
    writes = (
        PictureRequest, MotorCommand, Hypothesis, Goal, Discrepancy, Panorama, Obstruction, PlaceOdds, CameraState)

    def judge(self, view: View, trigger: Change) -> float | None:
        lost = open_discrepancy(view, Level.GOAL)
        if lost is None or find_belief(view) is None or is_over(view):
            return None
        if not is_standing(view) or _has_just_ridden(view):
            return None
        return 0.7

    def answer(self, view: View, trigger: Change) -> Iterable[Effect]:
        lost, belief = open_discrepancy(view, Level.GOAL), find_belief(view)
        if lost is None or belief is None:
            return
        if not isinstance(trigger.entry.value, Segments):
            yield Post(PictureRequest("probe"), (trigger.entry, lost))
            return
        if self._is_dark(trigger.entry.value):
            if len(_probes_since(view, lost)) < MAX_DARK_FRAMES:
                yield Post(PictureRequest("probe"), (trigger.entry, lost))
            return
        yield from self._consider(view, trigger.entry, lost, belief)

    def _is_dark(self, segments: Segments) -> bool:
        """Whether a frame is dark; a bright one without contrast shows a bare wall."""
        s = self._settings.goal
        return segments.contrast < s.min_contrast and segments.brightness < s.min_brightness

    def _consider(
        self, view: View, segments: Entry[Segments], lost: Entry[Discrepancy], belief: Entry[Hypothesis]
    ) -> Iterable[Effect]:
        before, robot = _panorama_since(view, lost), find_robot(view)
        glimpses = _collect_glimpses(view, segments, before, robot.actuator)
        looks, hidden = [_to_view(view, g) for g in glimpses], view.latest(Obstruction)
        known, tuning = None if hidden is None else hidden.value, self._settings.localization
        obstruction = update_obstruction(looks, robot.camera, known)
        if obstruction is not None:
            looks = [replace(g, segments_px=obstruction.without_its_own(g.segments_px)) for g in looks]
        because: tuple[object, ...] = (segments, lost)
        if (change := to_say(hidden, obstruction, because)) is not None:
            yield change
        if obstruction is not None:
            because = (segments, lost, hidden if change is None else change)
        building, rooms = find_building(view), self._list_rooms(view, belief.value)
        locale = belief.value.locale
        here = belief.value.world_from_robot(building)
        told = StatedPlace(here, belief.value.covariance_world(building), _find_prior(view, tuning))
        followed = _list_moved_candidates(view, before, robot.actuator, building)
        tried = []
        for camera, among in itertools.product(self._list_cameras(view), self._list_buildings(view)):
            by = find_robot(view, camera).in_building(among).with_obstruction(obstruction).on_floor_of(locale)
            tried.append((localize(by, looks, rooms, self._settings, (locale, here), followed), by, camera))
        seen_result, looking, camera = max(tried, key=lambda one: _measure_fit(one[0]))  # of equals the first
        goal = self._settings.goal
        is_last = len(glimpses) >= (goal.max_far_probes if seen_result.candidates else MAX_PROBES)
        if is_last:
            seen_result = replace(seen_result, next_action=None)
        look_alike = make_alias_test(looking, [g.now_from_then for g in glimpses], self._settings)
        result = weigh_told(seen_result, told, look_alike, len(looks), tuning)
        odds = _odds_used(view, seen_result, result, told)
        if result.status is LocalizationStatus.AMBIGUOUS or result.next_action is None or is_last:
            result = _prefer_reachable(building, result, locale)
        far = self._find_far_action(looking, result, glimpses, rooms)
        if far is not None:
            result, is_last = replace(result, status=LocalizationStatus.PROBE, next_action=far), False
        for old in view.where(Hypothesis, lambda h: h.status == "candidate"):
            yield Retract(old, (segments,))
        said = _describe(result, is_far=far is not None) if odds is None else odds.sentence()
        panorama = Panorama(glimpses, said)
        seen = Post(panorama, because) if before is None else Revise(before, panorama, (*because, before))
        yield seen
        if result.status is LocalizationStatus.FOUND:
            why: tuple[Effect, ...] = (seen,)
            if odds is not None:
                why = (seen, Post(odds, (seen, belief)))
                yield why[1]
            learnt = view.latest(CameraState)
            if learnt is not None and learnt.value != camera:
                yield Revise(learnt, camera, (seen, learnt))
            yield from self._adopt(view, (segments, *why), lost, belief, result.candidates[0])
            return
        for c in result.candidates:
            yield Post(_to_hypothesis(building, c, belief.value, "candidate", c.weight), (segments, seen, belief))
        if result.status is LocalizationStatus.PROBE and result.next_action is not None and not is_last:
            s, action = self._settings.action, result.next_action  # while lost, no floor is known to be free
            slowly = s.creep_speed_m_per_s if s.keeps_to_seen_floor and action.move_m > 0.0 else None
            yield Post(MotorCommand(action.turn_rad, action.move_m, slowly), (segments, lost, seen))

    def _list_cameras(self, view: View) -> tuple[CameraState, ...]:
        """The camera as it was learnt; also as it was told, where few pictures taught otherwise: if the place was not
        where it was believed, they made the camera fit the wrong place.
        """
        camera = find_camera(view)
        is_sure = camera.told_lens is None or len(camera.counted) > self._settings.localization.max_doubted_pictures
        return (camera,) if is_sure else (camera, camera.as_told())

    def _list_buildings(self, view: View) -> tuple[FrameBuilding, ...]:
        """The building as it is known; also without the things that it was found to have besides: if the place was not
        where it was believed, they may be put where the robot stands or where its view is.
        """
        bare = find_building_as_filed(view)
        return (find_building(view),) if bare is None else (find_building(view), bare)

    def _find_far_action(
        self, robot: RobotModel, result: LocalizationResult, glimpses: Sequence[Glimpse], rooms: Sequence[str]
    ) -> SensingAction | None:
        """The first leg of the way to a view that tells places apart that look alike from wherever it has looked."""
        s, looks = self._settings, len(glimpses)
        is_stuck = result.status is LocalizationStatus.AMBIGUOUS or result.next_action is None
        accepted = sum(bool(c.is_accepted) for c in result.candidates)
        if result.status is LocalizationStatus.FOUND or accepted < 2 or looks >= s.goal.max_far_probes:
            return None
        if looks < s.localization.min_views or not (is_stuck or looks >= s.localization.max_searched_views):
            return None
        hypotheses, looked = [c.hypothesis for c in result.candidates], [g.now_from_then for g in glimpses]
        return choose_far_action(robot, hypotheses, looked, rooms, make_view_predictor(robot, s))

    def _list_rooms(self, view: View, belief: Hypothesis) -> list[str]:
        """The rooms of the floor, the nearest to the last belief first; other floors are not searched."""
        building = find_building(view)
        here, level_m = belief.world_from_robot(building), building.floor_m(belief.locale)
        container = building.locale(belief.locale).parent or belief.locale
        rooms = self._list_rooms_of_floor(building, container, level_m)
        while len(rooms) < 2 and (above := building.locale(container).parent) is not None:  # as from an elevator's car
            container = above
            rooms = self._list_rooms_of_floor(building, container, level_m)
        away = [(_distance(building.outline(name), here), name) for name in rooms]
        return [name for _, name in sorted(away)[:self._settings.goal.max_rooms]]

    def _list_rooms_of_floor(self, building: FrameBuilding, container: str, level_m: float) -> list[str]:
        rooms = building.list_rooms_in(container, level_m, self._settings.goal.max_floor_difference_m)
        building.require(rooms)
        same_m = self._settings.goal.max_floor_difference_m
        return [name for name in rooms if abs(building.floor_m(name) - level_m) < same_m]

    def _adopt(
        self, view: View, seen: tuple[Entry[Segments] | Effect, ...], lost: Entry[Discrepancy],
        belief: Entry[Hypothesis], candidate: PlaceCandidate,
    ) -> Iterable[Effect]:
        """The belief is corrected, and a new top-level goal takes the place of the old one (§2)."""
        building = find_building(view)
        here = Revise(belief, _to_hypothesis(building, candidate, belief.value, "held", 1.0), (*seen, lost, belief))
        yield here
        yield Revise(lost, lost.value.corrected(), (here,))
        for level in (Level.ACTION, Level.PLAN):
            lower = open_discrepancy(view, level)
            if lower is not None:
                yield Revise(lower, lower.value.corrected(), (here,))
        goal = active_goal(view)
        if goal is None:
            return
        abandon = Revise(goal, replace(goal.value, status="abandoned"), (here,))
        yield abandon
        pose = candidate.world_from_robot
        origin = Place.of_world(building, candidate.room, pose.x_m, pose.y_m)
        yield Post(Goal(origin, goal.value.destination), (here, abandon))


def _measure_fit(result: LocalizationResult) -> float:
    """The log likelihood of the best place."""
    return max((c.likelihood.log_likelihood for c in result.candidates), default=-math.inf)


def _find_prior(view: View, settings: LocalizationSettings) -> float:
    """Probability of the believed place: as told, with all that was seen since it was told or found."""
    known, p_told = view.latest(TwinOdds), compute_prior(len(view.where(PlaceOdds, lambda _: True)), settings)
    return p_told if known is None else max(settings.min_p_twin, min(known.value.probability, p_told))


def _odds_used(
    view: View, by_pictures: LocalizationResult, result: LocalizationResult, told: StatedPlace
) -> PlaceOdds | None:
    """The odds by which a place was found that the pictures alone had not found; None where they had."""
    if result.status is not LocalizationStatus.FOUND or by_pictures.status is LocalizationStatus.FOUND:
        return None
    found, count = result.candidates[0], len(by_pictures.candidates)
    tracked = view.latest(Certificate, lambda c: c.verdict == "verified")
    return PlaceOdds(found.room, count, "told" if tracked is None else "tracked", told.p_told, found.weight)


def _prefer_reachable(building: Building, result: LocalizationResult, locale: str) -> LocalizationResult:
    """Of places that nothing more can tell apart the only one to which wheels lead from where the robot was.

    Carried to another place of where it can drive to, it may look the same there: that stays ambiguous. But being
    carried through a wall or up the stairs, to a place that looks just like one within reach, is not believed.
    """
    near = [c for c in result.candidates if building.route(locale, c.room) is not None]
    if result.status is LocalizationStatus.FOUND or len(near) != 1 or not near[0].is_accepted:
        return result
    return LocalizationResult(LocalizationStatus.FOUND, (replace(near[0], weight=1.0),))


def _collect_glimpses(
    view: View, segments: Entry[Segments], before: Entry[Panorama] | None, actuator: ActuatorModel
) -> tuple[Glimpse, ...]:
    """The looks so far, as seen from where the robot is now, and the new one."""
    old = () if before is None else before.value.glimpses
    for report in () if before is None else view.since(MotionReport, before.cycle):
        old = tuple(_move(g, report.value, actuator) for g in old)
    here = Glimpse(segments.id, Pose2(0.0, 0.0, 0.0), covariance_tuple(np.zeros((3, 3))))
    return (*old, here)


def _move(glimpse: Glimpse, report: MotionReport, actuator: ActuatorModel) -> Glimpse:
    claim = report.turn_rad, report.move_m
    step, spread = actuator.predict_motion(*claim), actuator.motion_covariance(*claim)
    pose, covariance = propagate_pose(glimpse.now_from_then, np.array(glimpse.covariance), step, spread)
    return replace(glimpse, now_from_then=pose, covariance=covariance_tuple(covariance))


def _to_hypothesis(
    building: Building, candidate: PlaceCandidate, belief: Hypothesis, status: HypothesisStatus, weight: float
) -> Hypothesis:
    return Hypothesis.of_world(
        building, candidate.room, candidate.world_from_robot, candidate.covariance, "relocalization",
        status=status, weight=weight, motion=belief.motion, evidence=str(candidate.likelihood),
    )


def _has_just_ridden(view: View) -> bool:
    """Whether no milestone has borne out an elevator ride yet: then it may be on any floor."""
    return view.latest(PlanSketch, lambda s: s.is_active and s.at > 0 and not s.verified
                       and s.subgoals[s.at - 1].is_ride) is not None


def _list_moved_candidates(
    view: View, before: Entry[Panorama] | None, actuator: ActuatorModel, building: FrameBuilding
) -> list[tuple[str, Pose2]]:
    """Room and pose of the candidates of the last look, as the robot has moved since."""
    out = []
    for entry in () if before is None else view.where(Hypothesis, lambda h: h.status == "candidate"):
        pose = entry.value.world_from_robot(building)
        for report in view.since(MotionReport, entry.cycle):
            pose = pose @ actuator.predict_motion(report.value.turn_rad, report.value.move_m)
        out.append((entry.value.locale, pose))
    return out


def _describe(result: LocalizationResult, *, is_far: bool) -> str:
    places = " or ".join(f"{c.room} ({c.weight:.0%})" for c in result.candidates)
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


def _to_view(view: View, glimpse: Glimpse) -> CameraView:
    return CameraView(view[glimpse.segments].value.segments_px, glimpse.now_from_then, np.array(glimpse.covariance))


def _distance(outline: object, here: Pose2) -> float:
    """From a robot to the nearest corner of a room [m]: good enough for an order."""
    corners = np.asarray(outline, float)
    return float(np.min(np.hypot(corners[:, 0] - here.x_m, corners[:, 1] - here.y_m)))


def _panorama_since(view: View, lost: Entry[Discrepancy]) -> Entry[Panorama] | None:
    found = view.latest(Panorama)
    return found if found is not None and found.cycle >= lost.cycle else None


def _probes_since(view: View, lost: Entry[Discrepancy]) -> tuple[Entry[Segments], ...]:
    """The probes that were looked at since the robot is lost, this one included."""
    return tuple(s for s in view.since(Segments, lost.cycle) if s.value.milestone == "")
