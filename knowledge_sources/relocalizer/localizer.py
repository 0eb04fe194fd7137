"""Localizer (§2, §4): every place of the floor that agrees with a lost robot's pictures, until one is left."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from blackboard import Change, Effect, Entry, Level, Post, Posted, Retract, Revised, View, Watch
from knowledge_sources.methods import localization
from knowledge_sources.methods.calibration import compute_camera_covariance
from knowledge_sources.methods.localization import MAX_FAR_PROBES
from knowledge_sources.priority import Priority
from knowledge_sources.reads import (
    HELD,
    LOST,
    WHILE_LOST,
    count_refuted,
    find_building,
    find_building_as_filed,
    find_camera,
    find_p_there,
    find_robot,
    list_contacts,
    list_views,
    locate_contact,
)
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.building.model_errors import find_sigma_m
from world_models.entries import (
    CameraState,
    Certificate,
    Hypothesis,
    MotionReport,
    Obstruction,
    Panorama,
    PlaceOdds,
    PlaceSearch,
)
from world_models.frame_building import FrameBuilding
from world_models.frames import Pose2

MAX_DOUBTED_PICTURES = 3  # the nominal camera is tried too, where so few pictures corrected it, when the robot is lost
MAX_PROBES = 8  # so many looks are taken when lost and no place fits; then the robot says that it does not know


class Localizer(RobotKnowledgeSource):
    """Keeps every place of the floor that agrees with the panorama, and says which next look tells most.

    Among places that look alike from here, that is on the way to a view that tells them apart, over floor that is free
    in all of them. Of such places the prior one, or the one it was tracked to, is believed if it is likely
    enough. Otherwise the robot stays lost and the candidates stay on the board: it never guesses. Either all holds that
    was learnt of camera and building where it was believed to be, or none of it.
    """

    level = closes = Level.GOAL
    priority = Priority.RECOVER
    on = (Watch(Panorama, (Posted, Revised)),)
    needs = WHILE_LOST
    writes = (PlaceSearch, Hypothesis, PlaceOdds)

    def act(self, view: View, case: Change) -> Iterable[Effect]:
        panorama, doubt, held, hidden = case.entry, LOST.of(view), HELD.of(view), view.latest(Obstruction)
        candidates = view.where(Hypothesis, lambda h: h.status == "candidate")
        building, locale, here = held.world, held.locale, held.pose
        refuted = count_refuted(view, doubt)
        p_there = find_p_there(view, refuted)
        stated = localization.StatedPlace(here, held.covariance, p_there)
        looked = [glimpse.now_from_then for glimpse in panorama.value.glimpses]
        looks, obstruction = list_views(view, panorama.value.glimpses), None if hidden is None else hidden.value
        if obstruction is not None:
            looks = [replace(g, segments_px=obstruction.without_its_own(g.segments_px)) for g in looks]
        rooms = localization.list_rooms(building, locale, here)
        followed = _follow(view, candidates, building)
        contacts = list_contacts(view, doubt)
        touched = [locate_contact(view, contact) for contact in contacts]
        cameras, buildings = self._list_cameras(view), self._list_buildings(view)
        asked = [(cameras[0], buildings[0]), (cameras[-1], buildings[-1])][:max(len(cameras), len(buildings))]
        robots = [find_robot(view, camera).in_building(among).with_obstruction(obstruction).on_floor_of(locale)
                  for camera, among in asked]
        what = localization.Search(looks, rooms, (locale, here), followed, touched, stated.p_prior)
        seen, which = localization.search(robots, what)
        is_last = len(looks) >= (MAX_FAR_PROBES if seen.candidates else MAX_PROBES)
        seen = replace(seen, next_action=None) if is_last else seen
        are_aliases = localization.make_alias_test(robots[which], looked)
        result = localization.weigh_prior(seen, stated, are_aliases, len(looks))
        verified = view.latest(Certificate, lambda c: c.verdict == "verified")
        odds = localization.find_odds_used(seen, result, stated, was_tracked=verified is not None, refuted=refuted)
        if result.status is localization.LocalizationStatus.AMBIGUOUS or result.next_action is None or is_last:
            result = localization.prefer_reachable(building, result, locale)
        far = localization.find_far_action(robots[which], result, looked, rooms, touched)
        if far is not None:
            result = replace(result, status=localization.LocalizationStatus.PROBE, next_action=far)
        said = odds.sentence() if odds is not None else localization.describe(
            result, is_far=far is not None, looks=len(looks))
        step = result.next_action if result.status is localization.LocalizationStatus.PROBE else None
        probe = None if step is None else (step.turn_rad, step.move_m)
        because = (panorama, doubt, held.entry, *candidates, *contacts, *(() if hidden is None else (hidden,)))
        found = Post(PlaceSearch(result.status.value, said, probe, which >= 1 and len(cameras) > 1), because)
        yield found
        yield from (Retract(old, (found,)) for old in candidates)
        if odds is not None:
            yield Post(odds, (found, held.entry))
        is_found = result.status is localization.LocalizationStatus.FOUND
        for c in result.candidates[:1] if is_found else result.candidates:
            model_m = find_sigma_m(building, c.room)
            spread = c.covariance + np.diag(np.square([model_m, model_m, 0.0]))  # no look averages the model's errors
            there = held.moved_to(c.world_from_robot, spread, "relocalization", locale=c.room)
            if is_found:
                there = there.protected(localization.protect_place(
                    robots[which], looks, c.world_from_robot, spread, compute_camera_covariance(cameras[0]), model_m))
            place = replace(there, status="candidate", weight=c.weight, evidence=str(c.likelihood))
            yield Post(place, (found, panorama, held.entry))

    def _list_cameras(self, view: View) -> tuple[CameraState, ...]:
        """The camera as it was learnt; also the nominal one, where few pictures corrected it: if the place was not
        where it was believed, they made the camera fit the wrong place.
        """
        camera = find_camera(view)
        is_sure = camera.nominal_lens is None or len(camera.counted) > MAX_DOUBTED_PICTURES
        return (camera,) if is_sure else (camera, camera.as_nominal())

    def _list_buildings(self, view: View) -> tuple[FrameBuilding, ...]:
        """The building as it is known; also without the things that it was found to have besides: if the place was not
        where it was believed, they may be put where the robot stands or where its view is.
        """
        bare = find_building_as_filed(view)
        return (find_building(view),) if bare is None else (find_building(view), bare)


def _follow(view: View, candidates: Iterable[Entry[Hypothesis]], building: FrameBuilding) -> list[tuple[str, Pose2]]:
    """Room and pose of the candidates of the last search, as the robot has moved since."""
    out, actuator = [], find_robot(view).actuator
    for entry in candidates:
        pose = entry.value.world_from_robot(building)
        for report in view.since(MotionReport, entry.cycle):
            pose = pose @ actuator.predict_motion(report.value.turn_rad, report.value.move_m)
        out.append((entry.value.locale, pose))
    return out
