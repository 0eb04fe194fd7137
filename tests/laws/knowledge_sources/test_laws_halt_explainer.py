"""Law of what is ahead: exactly what is suspected within the robot's next sweep is held to be there."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import get_args

import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from blackboard import Posted, Revise, Revised
from harvey.testing import answer, check_source
from knowledge_sources.model.halt_explainer import HaltExplainer
from knowledge_sources.reads import SEEN_MARGIN_M
from knowledge_sources.settings import DEFAULT
from things_in_hall import CARTON, HALL, HERE, Hall
from world_models.entries import Goal, Leg, Obstacle, ObstacleStatus, Place, PlanSketch, Subgoal
from world_models.entries.task import LegStatus

SOURCE = HaltExplainer()
things = st.lists(st.tuples(st.floats(-4.0, 4.0), st.floats(-1.5, 1.5), st.sampled_from(get_args(ObstacleStatus))),
                  min_size=1, max_size=4)
"""How far each is from the carton's place, and how it is known."""


def leg_to(dx_m: float, dy_m: float, status: LegStatus = "halted") -> Leg:
    return Leg("PlanSketch-1", 0, HERE.x_m, HERE.y_m, HERE.x_m + dx_m, HERE.y_m + dy_m, 0.05, status=status)


@pytest.mark.parametrize("status", get_args(ObstacleStatus))
@pytest.mark.parametrize(("turn_rad", "is_next"), [(0.0, True), (0.3, True), (-0.3, True), (0.9, False), (2.0, False)])
def test_what_is_suspected_next_on_the_way_is_held_before_the_leg_is_halted(
    turn_rad: float, is_next: bool, status: ObstacleStatus
) -> None:
    hall = Hall(())
    here, there = (Place(HALL, x_m, 1.2) for x_m in (2.0, 6.0))
    goal = hall.put(Goal(here, there))
    sketch = hall.put(PlanSketch(goal.id, (), "", (Subgoal(here, there, primitive=True),), verified=True))
    leg = hall.put(replace(leg_to(3.0 * math.cos(turn_rad), 3.0 * math.sin(turn_rad), "moving"), sketch=sketch.id))
    near = tuple((x - 2.0 + DEFAULT.action.act_within_m, y) for x, y in CARTON)  # its front where the next way ends
    thing = hall.put(Obstacle(f"{HALL}/obstacle-1", HALL, near, 0.05, 0.0, 0.0, 0.5, certainty=0.7, status=status))
    _, watch = SOURCE.on
    assert watch.sees(Posted(thing)) == watch.sees(Revised(thing)) == (status == "suspected")
    (effect,) = answer(SOURCE, hall.board.view, Posted(thing)) or (None,)
    assert (effect is not None) == (is_next and status == "suspected")
    if effect is not None:
        assert effect.value.is_there and set(effect.because) == {thing, leg, hall.belief()}


@pytest.mark.parametrize(("beyond_rim_m", "is_met"), [(-0.01, True), (0.01, False)])
def test_the_sweep_is_the_robot_with_the_margin_within_which_floor_must_be_seen(
    beyond_rim_m: float, is_met: bool
) -> None:
    hall = Hall(())
    aside_m = hall.robot.radius_m + SEEN_MARGIN_M + beyond_rim_m
    corners = tuple((HERE.x_m + x, HERE.y_m + aside_m + y) for x, y in ((0.2, 0.0), (0.5, 0.0), (0.5, 0.3), (0.2, 0.3)))
    hall.put(Obstacle(f"{HALL}/obstacle-1", HALL, corners, 0.05, 0.0, 0.0, 0.5, certainty=0.7, status="suspected"))
    leg = hall.put(leg_to(3.0, 0.0))
    assert (answer(SOURCE, hall.board.view, Revised(leg)) is not None) == is_met


@given(things, st.floats(-4.0, 4.0), st.floats(-0.8, 0.8))
@settings(max_examples=60, deadline=None)
def test_what_is_suspected_in_the_next_sweep_is_there_and_nothing_else(
    drawn: list[tuple[float, float, ObstacleStatus]], dx_m: float, dy_m: float
) -> None:
    hall = Hall(())
    entries = []
    for number, (by_x_m, by_y_m, status) in enumerate(drawn, 1):
        corners = tuple((x + by_x_m, y + by_y_m) for x, y in CARTON)
        entries.append(hall.put(Obstacle(f"{HALL}/obstacle-{number}", HALL, corners, 0.05, 0.0, 0.0, 0.5,
                                         certainty=0.7, status=status)))
    leg = hall.put(leg_to(dx_m, dy_m))
    length_m = (dx_m**2 + dy_m**2) ** 0.5
    assume(length_m > 0.01)
    part = min(1.0, DEFAULT.action.act_within_m / length_m)
    way = shapely.LineString([HERE.position, (HERE.x_m + part * dx_m, HERE.y_m + part * dy_m)])
    gaps = [way.distance(shapely.Polygon(entry.value.footprint)) for entry in entries]
    rim_m = hall.robot.radius_m + SEEN_MARGIN_M
    assume(all(abs(gap - rim_m) > 0.02 for gap in gaps))
    met = [entry for entry, gap in zip(entries, gaps, strict=True) if gap < rim_m and entry.value.status == "suspected"]
    effects = answer(SOURCE, hall.board.view, Revised(leg))
    assert (effects is not None) == bool(met)
    for entry, effect in zip(met, effects or (), strict=True):
        assert isinstance(effect, Revise) and effect.entry is entry
        assert effect.value == replace(entry.value, status="there")
        assert set(effect.because) == {entry, leg, hall.belief()}
    hall.apply(*(effects or ()))
    assert answer(SOURCE, hall.board.view, Revised(leg)) is None


def test_it_keeps_the_laws_of_all_sources() -> None:
    hall = Hall(())
    thing = hall.put(Obstacle(f"{HALL}/obstacle-1", HALL, tuple((x - 1.5, y) for x, y in CARTON), 0.05, 0.0, 0.0, 0.5,
                              certainty=0.7, status="suspected"))
    check_source(SOURCE, hall.bench, Revised(hall.put(leg_to(3.0, 0.0))), without=(thing.id,))
