"""Laws of the localizer: places that agree with the looks stay and go with the robot; no move leads to what it felt."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard.change import Posted
from blackboard.effect import Post, Retract
from blackboard.entry import Entry
from generated_boards import HALL, Bench, drive, go, made, motions, plain_robot, poses, reasons, to_world, wakes
from knowledge_sources.goal.localizer import Localizer, _follow
from knowledge_sources.methods.localization.global_localization import LocalizationResult, LocalizationStatus
from knowledge_sources.methods.localization.next_view import SensingAction
from knowledge_sources.methods.localization.place_search import Search
from knowledge_sources.methods.verification.line_check import predict_lines
from knowledge_sources.questions import find_building
from knowledge_sources.settings import DEFAULT
from world_models.actuator import ActuatorModel
from world_models.entries.location import Hypothesis, PlaceOdds, PlaceSearch, diagonal
from world_models.entries.obstacle import Contact
from world_models.entries.percepts import Glimpse, Panorama, Segments
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
        lines = predict_lines(ROBOT, now @ Pose2(0.0, 0.0, turn), DEFAULT.verification).segments_px
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

    def note(robots: Any, what: Search, _: Any) -> tuple[LocalizationResult, int]:
        asked.append(what)
        return LocalizationResult(LocalizationStatus.PROBE, (), SensingAction(1.0, 0.0, 0.0)), len([*robots]) - 1

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("knowledge_sources.goal.localizer.search", note)
        effects: Any = bench.ask(SOURCE, look_round(bench, (0.0,)))
    ((felt,),) = [what.touched for what in asked]
    assert felt == pytest.approx(ROBOT.radius_m * np.array([math.cos(direction), math.sin(direction)]))
    assert isinstance(effects[0], Post) and touch.id in reasons(effects[0])
    assert effects[0].value.probe == (1.0, 0.0)


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


@pytest.mark.parametrize("lacks", ["nothing", "doubt", "belief", "rest"])
def test_places_are_searched_only_when_lost_and_standing(lacks: str) -> None:
    bench = Bench(plain_robot())
    if lacks != "belief":
        bench.believe()
    if lacks != "doubt":
        bench.doubt()
    panorama = bench.put(Panorama(()))
    if lacks == "rest":
        bench.move()
    assert (SOURCE.find_case(bench.view, Posted(panorama)) is not None) == (lacks == "nothing")
    assert wakes(SOURCE, Posted(panorama))
