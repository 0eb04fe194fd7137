"""Laws of the localizer: places that agree with the looks stay and go with the robot; no move leads to what it felt."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Entry, Level, Post, Retract
from generated_boards import Bench, drive, go, made, motions, poses, reasons, to_world
from harvey.testing import HALL, check_source, plain_robot
from knowledge_sources.methods.localization import (
    LOST_AGAIN_ODDS,
    MAX_FAR_PROBES,
    P_STATED,
    LocalizationStatus,
    Search,
)
from knowledge_sources.methods.localization.global_localization import LocalizationResult, PlaceCandidate
from knowledge_sources.methods.localization.next_view import SensingAction
from knowledge_sources.methods.localization.none_of_these import MIN_P_PLACE
from knowledge_sources.methods.localization.refinement import PoseLikelihood
from knowledge_sources.methods.verification import predict_lines
from knowledge_sources.model.model_reviser import ModelReviser
from knowledge_sources.reads import find_building
from knowledge_sources.relocalizer.localizer import MAX_DOUBTED_PICTURES, MAX_PROBES, Localizer, _follow
from world_models.actuator import ActuatorModel
from world_models.entries import (
    Certificate,
    Contact,
    Discrepancy,
    Glimpse,
    Hypothesis,
    Obstacle,
    Obstruction,
    Panorama,
    PlaceOdds,
    PlaceSearch,
    Segments,
    diagonal,
)
from world_models.files.world_files import WORLDS, load_world
from world_models.frames import Pose2, flattened

SOURCE, ROOM = Localizer(), "reception"
ROBOT = plain_robot(load_world(WORLDS / "two_ways.toml"))
TRUTH = Pose2(3.4, 2.2, 0.4)


def in_world(pose: Pose2) -> Pose2:
    return flattened(ROBOT.world.world_from_locale(ROOM)) @ pose


def look_round(bench: Bench, turns: tuple[float, ...]) -> Entry[Panorama]:
    """Looks from where the robot is, each so far turned from the last; what should be seen is what is seen."""
    looks, now = [], in_world(TRUTH)
    for turn in turns:
        lines = predict_lines(ROBOT, now @ Pose2(0.0, 0.0, turn)).segments_px
        seen = bench.put(Segments("CameraPicture-1", "", lines, np.full(len(lines), 0.4), 40.0, 120.0))
        looks.append(Glimpse(seen.id, Pose2(0.0, 0.0, turn), diagonal(0.0, 1e-3 if turn else 0.0)))
    return bench.put(Panorama(tuple(looks)))


def lose(off: Pose2 | None = None) -> Bench:
    """A lost robot that believes to be so far from where it is."""
    bench = Bench(ROBOT)
    bench.believe(TRUTH @ (off or Pose2(0.0, 0.0, 0.0)), diagonal(0.05, 0.02), locale=ROOM)
    bench.doubt()
    return bench


@pytest.mark.parametrize("off", [Pose2(0.1, 0.05, 0.05), Pose2(-0.9, 0.6, 0.8)])
def test_by_two_looks_it_finds_where_it_is_whatever_it_believed(off: Pose2) -> None:
    bench = lose(off)
    old = bench.put(Hypothesis(ROOM, Pose2(1.0, 1.0, 0.0), diagonal(0.1, 0.1), "relocalization", status="candidate"))
    effects: Any = bench.ask(SOURCE, look_round(bench, (math.pi / 2, 0.0)))
    (search,) = made(effects, PlaceSearch)
    (found,) = made(effects, Hypothesis)
    assert search.status == "found" and search.probe is None
    pose = found.world_from_robot(ROBOT.world)
    assert (found.locale, found.status, found.basis) == (ROOM, "candidate", "relocalization")
    assert pose.distance_to(in_world(TRUTH)) < 0.02
    assert abs(math.remainder(pose.heading_rad - in_world(TRUTH).heading_rad, math.tau)) < 0.01
    assert [effect.entry for effect in effects if isinstance(effect, Retract)] == [old]
    assert reasons(effects[0]) == {"Panorama-1", "Discrepancy-1", "Hypothesis-1", old.id}
    assert made(effects, PlaceOdds) == []  # the pictures alone told
    assert found.weight >= MIN_P_PLACE  # against none of these too
    assert pose.distance_to(in_world(TRUTH)) < found.protection_m and found.excess_m > 0.0


def test_by_one_look_it_asks_for_another() -> None:
    bench = lose()
    effects: Any = bench.ask(SOURCE, look_round(bench, (0.0,)))
    (search,) = made(effects, PlaceSearch)
    assert search.status == "probe" and search.probe is not None and search.probe != (0.0, 0.0)
    assert any(h.world_from_robot(ROBOT.world).distance_to(in_world(TRUTH)) < 0.05 for h in made(effects, Hypothesis))


@pytest.mark.parametrize("direction", [0.0, 0.6, -0.6, math.pi])
def test_what_it_has_felt_is_part_of_the_search_and_of_the_reasons(direction: float) -> None:
    """At its rim; that no move leads there is the law of the search (tests/laws/localization/test_laws_touched.py)."""
    bench, asked = lose(), list[Search]()
    command, _ = bench.move(0.0, 0.0)
    bench.revise(bench.view["Hypothesis-1"], motion="MotionReport-1")
    touch = bench.put(Contact("bumper", direction, 0.2, 1.0), command)

    def note(robots: Any, what: Search) -> tuple[LocalizationResult, int]:
        asked.append(what)
        return LocalizationResult(LocalizationStatus.PROBE, (), SensingAction(1.0, 0.0, 0.0)), len([*robots]) - 1

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("knowledge_sources.methods.localization.search", note)
        effects: Any = bench.ask(SOURCE, look_round(bench, (0.0,)))
    ((felt,),) = [what.touched for what in asked]
    assert felt == pytest.approx(ROBOT.radius_m * np.array([math.cos(direction), math.sin(direction)]))
    assert isinstance(effects[0], Post) and touch.id in reasons(effects[0])
    assert effects[0].value.probe == (1.0, 0.0)


FOUND, PROBE, AMBIGUOUS = LocalizationStatus.FOUND, LocalizationStatus.PROBE, LocalizationStatus.AMBIGUOUS
ACTION = SensingAction(1.0, 0.3, 2.0)


def candidate(pose: Pose2, log_likelihood: float, weight: float = 0.5) -> PlaceCandidate:
    """A place that the looks confirm, and the robot's pose in its room."""
    fits = PoseLikelihood(20, 18, log_likelihood, 0.9)
    return PlaceCandidate(ROOM, in_world(pose), np.diag([1e-3, 2e-3, 1e-4]), fits, True, weight)


def search_says(bench: Bench, panorama: Entry[Panorama], result: LocalizationResult, which: int = 0
                ) -> tuple[Any, list[Any]]:
    """What the localizer makes of a result of the search; and of whom that was asked."""
    asked: list[Any] = []

    def answer(robots: Any, what: Search) -> tuple[LocalizationResult, int]:
        asked.extend(robots)
        return result, which

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("knowledge_sources.methods.localization.search", answer)
        patch.setattr("knowledge_sources.methods.localization.find_far_action", lambda *_: None)
        return bench.ask(SOURCE, panorama), asked


FEW = MAX_DOUBTED_PICTURES


@pytest.mark.parametrize("counted", [0, FEW, FEW + 1])
@pytest.mark.parametrize("learnt", [False, True])
@pytest.mark.parametrize("finds", [False, True])
def test_what_may_have_been_learnt_at_the_wrong_place_is_tried_as_it_was_told(
    counted: int, learnt: bool, finds: bool
) -> None:
    """A camera that few pictures taught, with the building without what it was found to have; which of them fitted."""
    bench = lose()
    camera = bench.view["CameraState-1"]
    if learnt:
        moved = camera.value.moved((0.01,) + (0.0,) * 6)
        bench.revise(camera, lens=moved.lens, mount=moved.mount, nominal_lens=moved.nominal_lens,
                     nominal_mount=moved.nominal_mount, counted=((0.0, 0.0, 0.0),) * counted)
    if finds:
        box = tuple((float(x), float(y)) for x, y in (in_world(Pose2(1.0 + dx, 1.0 + dy, 0.0)).position
                                                      for dx, dy in ((-.1, -.1), (.1, -.1), (.1, .1), (-.1, .1))))
        thing = bench.put(Obstacle(f"{ROOM}/obstacle-1", ROOM, box, 0.02, 1.0, 1.0, 0.2))
        bench.apply(*bench.ask(ModelReviser(), thing) or ())
    tilts = [camera.value.mount.tilt_rad + 0.01 * learnt]
    is_doubted = learnt and counted <= FEW
    if is_doubted or finds:
        tilts.append(camera.value.mount.tilt_rad if is_doubted else tilts[0])
    panorama = look_round(bench, (0.0,))
    for which in range(len(tilts)):
        effects, asked = search_says(bench, panorama, LocalizationResult(PROBE, (), ACTION), which)
        assert [robot.mount.tilt_rad for robot in asked] == pytest.approx(tilts)
        assert [sum(t.name.endswith("obstacle-1") for t in robot.world.things_of(ROOM)) for robot in asked] == (
            [int(finds), 0][:len(tilts)])
        (found,) = made(effects, PlaceSearch)
        assert found.is_camera_nominal == (is_doubted and which == 1)


@pytest.mark.parametrize("places", [0, 2])
@pytest.mark.parametrize("more", [-1, 0])
def test_so_many_looks_are_taken(places: int, more: int) -> None:
    """More of them where some place fits."""
    bench = lose()
    most = MAX_FAR_PROBES if places else MAX_PROBES
    one = look_round(bench, (0.0,)).value.glimpses[0]
    panorama = bench.put(Panorama((one,) * (most + more)))
    fits = tuple(candidate(Pose2(1.0 + k, 1.0, 0.0), 9.0) for k in range(places))
    effects, _ = search_says(bench, panorama, LocalizationResult(PROBE, fits, ACTION))
    (found,) = made(effects, PlaceSearch)
    assert found.probe == (None if more == 0 else (ACTION.turn_rad, ACTION.move_m))


@pytest.mark.parametrize("is_hidden", [False, True])
def test_what_is_looked_for_is_all_that_it_knows_of_where_it_may_be(is_hidden: bool) -> None:
    """The looks without the lines of what stands before the camera; the rooms from where it was; what it followed."""
    bench = lose(Pose2(0.4, -0.3, 0.2))
    if is_hidden:
        box = ((20.0, 20.0), (80.0, 20.0), (80.0, 120.0), (20.0, 120.0))
        bench.put(Obstruction(box))
    old = bench.put(Hypothesis(ROOM, Pose2(1.0, 1.0, 0.3), diagonal(0.1, 0.1), "relocalization", status="candidate"))
    own = np.array([[(20.0, 25.0), (20.0, 110.0)], [(80.0, 30.0), (80.0, 100.0)]])
    other = np.array([[(150.0, 30.0), (150.0, 200.0)], [(100.0, 210.0), (220.0, 215.0)]])
    seen = bench.put(Segments("CameraPicture-1", "", np.concatenate([own, other]), np.full(4, 0.4), 40.0, 120.0))
    asked: list[Search] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("knowledge_sources.methods.localization.search", lambda robots, what: asked.append(what) or (
            LocalizationResult(PROBE, (), ACTION), len([*robots]) - 1))
        bench.ask(SOURCE, bench.put(Panorama((Glimpse(seen.id, Pose2(0.0, 0.0, 0.1), diagonal(0.0, 0.0)),))))
    (what,) = asked
    here = in_world(TRUTH @ Pose2(0.4, -0.3, 0.2))
    assert what.here[0] == ROOM and what.here[1].distance_to(here) < 1e-9
    assert set(what.rooms) == set(ROBOT.world.rooms)
    away = [min(math.dist(corner, here.position) for corner in ROBOT.world.outline(room)) for room in what.rooms]
    assert away == sorted(away)
    ((room, there),) = what.followed
    assert room == ROOM and there.distance_to(old.value.world_from_robot(ROBOT.world)) < 1e-9
    (look,) = what.looks
    assert np.array_equal(look.segments_px, other if is_hidden else np.concatenate([own, other]))


def test_all_places_that_fit_stay_until_one_is_found() -> None:
    bench = lose()
    bench.revise(bench.view["Hypothesis-1"], motion="MotionReport-7")
    fits = tuple(candidate(Pose2(1.0 + 0.5 * k, 1.0, 0.2 * k), 9.0 - k, 0.5 - 0.1 * k) for k in range(3))
    effects, _ = search_says(bench, look_round(bench, (0.0,)), LocalizationResult(PROBE, fits, ACTION))
    posted = made(effects, Hypothesis)
    assert [h.weight for h in posted] == pytest.approx([0.5, 0.4, 0.3])
    for h, c in zip(posted, fits, strict=True):
        assert (h.locale, h.status, h.basis, h.motion) == (ROOM, "candidate", "relocalization", "MotionReport-7")
        assert h.world_from_robot(ROBOT.world).distance_to(c.world_from_robot) < 1e-9
        assert np.allclose(h.covariance_world(ROBOT.world), c.covariance)
    effect = next(e for e in effects if not isinstance(e, Retract) and isinstance(e.value, Hypothesis))
    assert reasons(effect) == {"PlaceSearch", "Panorama-1", "Hypothesis-1"}


@pytest.mark.parametrize("refuted", [0, 1])
@pytest.mark.parametrize("verified", [False, True])
def test_the_odds_by_which_a_place_is_found_are_told_with_it(refuted: int, verified: bool) -> None:
    """Of two places that fit as well and look otherwise the one where it was told to be; Bayes' rule by hand."""
    bench = lose()
    if refuted:
        bench.revise(bench.view["Discrepancy-1"], status="corrected")
        bench.put(PlaceOdds(ROOM, 2, "stated", 0.9, 0.99, 0))
        bench.put(Discrepancy(Level.GOAL, "it is elsewhere", None, (0.0, 0.0), "px"))
    if verified:
        bench.put(Certificate("Milestone-1", "", "verified", "", 9, 9, 9, 0.9, 1.0, 0.0, 0.0, 3.0, 30.0, 0.001, 0.001,
                              0.006))
    here, there = candidate(TRUTH, 30.0), candidate(Pose2(1.0, 4.0, -2.0), 26.0)
    result = LocalizationResult(AMBIGUOUS, (there, here), None)
    effects, _ = search_says(bench, look_round(bench, (math.pi / 2, 0.0)), result)
    (odds,) = made(effects, PlaceOdds)
    prior = P_STATED / (1.0 - P_STATED) * LOST_AGAIN_ODDS**refuted
    assert odds.p_prior == pytest.approx(prior / (1.0 + prior)) and odds.refuted == refuted
    assert odds.probability == pytest.approx(1.0 / (1.0 + math.exp(-4.0) / prior), abs=1e-6)
    assert (odds.locale, odds.source) == (ROOM, "tracked" if verified else "stated")
    (kept,) = made(effects, Hypothesis)
    assert kept.world_from_robot(ROBOT.world).distance_to(in_world(TRUTH)) < 1e-9


@settings(max_examples=40, deadline=None)
@given(st.lists(poses, min_size=1, max_size=3), motions, motions)
def test_candidates_go_with_the_robot_from_when_they_were_found(
    found: list[Pose2], before: list[tuple[float, float]], way: list[tuple[float, float]]
) -> None:
    bench = Bench(plain_robot())
    bench.believe()
    drive(bench, before)
    candidates = tuple(bench.put(Hypothesis(HALL, pose, diagonal(0.1, 0.1), "relocalization", status="candidate"))
                       for pose in found)
    drive(bench, way)
    followed = _follow(bench.view, candidates, find_building(bench.view))
    assert len(followed) == len(found)
    for pose, (locale, there) in zip(found, followed, strict=True):
        wanted = to_world(pose)
        x, y, heading = wanted.x_m, wanted.y_m, wanted.heading_rad
        for motion in way:
            x, y, heading = go(x, y, heading, ActuatorModel().predict_motion(*motion))
        assert locale == HALL and (there.x_m, there.y_m) == pytest.approx((x, y), abs=1e-9)
        assert math.remainder(there.heading_rad - heading, math.tau) == pytest.approx(0.0, abs=1e-9)


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = lose()
    check_source(SOURCE, bench, look_round(bench, (0.0,)), most_hidden=1)
