"""Laws of the shut door explainer: a shut door explains a picture that refutes the place; an open one is never so."""

from __future__ import annotations

import math
import re

import pytest

from archive_door import DOOR, HALL, ROBOT, WORLD, before_door, photograph
from blackboard import Entry, Level, Revised
from generated_boards import Bench, effect_on, made, reasons
from harvey.testing import check_source
from knowledge_sources.milestone.line_finder import LineFinder
from knowledge_sources.model import shut_door_explainer
from knowledge_sources.model.shut_door_explainer import (
    MAX_DOUBTED_SIGMA_M,
    MAX_DOUBTED_SIGMA_RAD,
    REFUTED_LOG_RATIO,
    ShutDoorExplainer,
)
from knowledge_sources.reads.doors_in_view import MAX_SIGMA_M, MAX_SIGMA_RAD
from world_models.entries import CameraPicture, DoorState, Milestone, Segments, diagonal
from world_models.frames import Pose2, flattened

SOURCE = ShutDoorExplainer()
PRIOR = 4.0
"""Log odds that a door is as the file says, before anything is seen."""


def refute(
    pose: Pose2, *, is_shut: bool, sigma_m: float = 0.02, sigma_rad: float = 0.01, off: Pose2 | None = None
) -> tuple[Bench, Entry[Milestone]]:
    """A board on which a milestone was refuted by a picture from a pose, which is not as far ``off`` the belief."""
    bench = Bench(ROBOT)
    own = flattened(WORLD.world_from_locale(HALL)).inverse() @ (pose @ (off or Pose2(0.0, 0.0, 0.0)))
    bench.believe(own, diagonal(sigma_m, sigma_rad), locale=HALL)
    milestone = bench.await_milestone(status="expected", look_heading_rad=pose.heading_rad)
    frame = bench.put(CameraPicture(photograph(pose, is_shut), 1, 3.0, "milestone"))
    bench.apply(effect_on(bench.ask(LineFinder(), frame), Segments))
    bench.doubt(Level.PLAN, math.inf)
    return bench, bench.revise(milestone, status="refuted")


@pytest.mark.parametrize(("away_m", "aside_m"), [(2.0, 0.2), (3.0, -0.3), (4.0, 0.1)])
def test_a_shut_door_is_named_and_the_place_is_not_doubted(away_m: float, aside_m: float) -> None:
    bench, milestone = refute(before_door(away_m, aside_m), is_shut=True)
    effects = bench.ask(SOURCE, milestone)
    state = effect_on(effects, DoorState)
    assert (state.value.door, state.value.state, state.value.pictures) == (DOOR, "shut", 1)
    odds = min(state.value.last.log_ratio - PRIOR + REFUTED_LOG_RATIO, 7.0)
    assert state.value.log_odds == pytest.approx(odds)
    assert state.value.certainty == pytest.approx(1.0 / (1.0 + math.exp(-odds)))
    assert re.search(r"with it shut (\d+) of \d+ lines are where they should be", state.value.last.shows)
    assert reasons(state) == {"CameraPicture-1", milestone.id, "Hypothesis-1", "Segments-1"}
    assert [d.status for d in made(effects, type(bench.view["Discrepancy-1"].value))] == ["corrected"]


@pytest.mark.parametrize(("away_m", "aside_m"), [(1.2, 0.7), (2.0, 0.2), (3.0, -0.3), (4.0, 0.1), (2.5, 0.8)])
def test_an_open_door_is_never_called_shut(away_m: float, aside_m: float) -> None:
    bench, milestone = refute(before_door(away_m, aside_m), is_shut=False)
    assert made(bench.ask(SOURCE, milestone), DoorState) == []


def test_nor_is_one_that_is_not_where_the_robot_believes_it() -> None:
    """The picture fits with the door shut, but from another place: then it is the belief that is wrong."""
    bench, milestone = refute(before_door(3.0, 0.0), is_shut=True, off=Pose2(0.0, 0.6, 0.0))
    assert made(bench.ask(SOURCE, milestone), DoorState) == []


@pytest.mark.parametrize(("sigma_m", "sigma_rad", "acts"), [
    (MAX_DOUBTED_SIGMA_M - 1e-6, 0.01, True), (MAX_DOUBTED_SIGMA_M + 1e-6, 0.01, False),
    (0.02, MAX_DOUBTED_SIGMA_RAD - 1e-6, True), (0.02, MAX_DOUBTED_SIGMA_RAD + 1e-6, False)])
def test_it_acts_only_where_the_place_is_known_so_well(sigma_m: float, sigma_rad: float, acts: bool) -> None:
    bench, milestone = refute(before_door(3.0, 0.0), is_shut=True, sigma_m=sigma_m, sigma_rad=sigma_rad)
    assert (SOURCE.find_case(bench.view, Revised(milestone)) is not None) is acts


@pytest.mark.parametrize(("more_m", "more_rad", "sure"), [
    (-1e-6, -1e-6, True), (1e-6, -1e-6, False), (-1e-6, 1e-6, False)])
def test_few_lines_explain_only_where_place_and_heading_are_sure(
    more_m: float, more_rad: float, sure: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To a few lines the picture leaves the place open: then it is the belief that must be sharp, each deviation."""
    asked: list[bool] = []
    monkeypatch.setattr(shut_door_explainer, "is_explained", lambda *_, is_sure: bool(asked.append(is_sure)))
    bench, milestone = refute(before_door(3.0, 0.0), is_shut=True, sigma_m=MAX_SIGMA_M + more_m,
                              sigma_rad=MAX_SIGMA_RAD + more_rad)
    assert not bench.ask(SOURCE, milestone) and asked == [sure]


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench, milestone = refute(before_door(3.0, 0.0), is_shut=True)
    check_source(SOURCE, bench, milestone, without=("CameraPicture-1",))
    bench.revise(bench.view["Discrepancy-1"], magnitude=None)
    assert bench.ask(SOURCE, milestone) is None  # what is not measured is not explained
