"""Laws of clutter: as many things as asked for, where there is room, with a way left or none left, by the truth."""

from __future__ import annotations

from functools import cache
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.generated.clutter import KEPT_FREE_M, MAX_THINGS, ClutterMaker
from experiments.generated.free_floor import find_free_floor, find_shortest_way, has_way
from experiments.generated.missions import write_cluttered_mission
from sim.body.collision import ROBOT_RADIUS_M, Obstacles
from sim.ground_truth.things import ROLLED_OVER
from sim.scenario import load_scenario, parse_scenario
from sim.stage import Stage, build_stage
from world_models.frames import Pose2

SCENARIOS = ("shut-door", "lab-to-allens-office")


@cache
def maker_of(name: str) -> ClutterMaker:
    return ClutterMaker(build_stage(load_scenario(name)))


def stage_with(name: str, more: str) -> Stage:
    scenario = load_scenario(name)
    return build_stage(parse_scenario(scenario.source.text + more, name, scenario.folder))


@settings(deadline=None, max_examples=12)
@given(name=st.sampled_from(SCENARIOS), seed=st.integers(0, 10**6), leaves_way=st.booleans())
def test_a_way_is_left_or_none_is(name: str, seed: int, leaves_way: bool) -> None:
    clutter = maker_of(name).draw(seed, leaves_way=leaves_way)
    assert 1 <= len(clutter.things) <= MAX_THINGS and clutter.leaves_way == leaves_way
    stage = stage_with(name, clutter.text)
    obstacles = stage.building.obstacles
    assert has_way(find_free_floor(obstacles), stage.start_world, stage.goal_world) == leaves_way
    assert min(obstacles.clearance_m(end) for end in (stage.start_world, stage.goal_world)) > 0.0
    assert maker_of(name).draw(seed, leaves_way=leaves_way) == clutter


@settings(deadline=None, max_examples=12)
@given(seed=st.integers(0, 10**6), count=st.integers(1, MAX_THINGS))
def test_so_many_things_as_were_asked_for_stand_clear_of_walls_ends_and_each_other(seed: int, count: int) -> None:
    maker = maker_of("shut-door")
    clutter = maker.draw(seed, count=count)
    assert len(clutter.things) == count
    stage = stage_with("shut-door", clutter.text)
    own = [Obstacles.of_faces([f for f in stage.building.added if f.name.startswith(f"{t.locale}/extra-{i}-")])
           for i, t in enumerate(clutter.things) if t.kind not in ROLLED_OVER]
    for obstacles in own:
        assert all(obstacles.clearance_m(end, 0.0) > KEPT_FREE_M - 1e-3
                   for end in (stage.start_world, stage.goal_world))
    for one, other in combinations(own, 2):
        corners = one.segments_world.reshape(-1, 2)
        assert min(other.clearance_m(Pose2(float(x), float(y), 0.0), 0.0) for x, y in corners) > 0.0


@given(width_m=st.floats(0.3, 1.5))
def test_there_is_a_way_through_a_gap_that_is_wider_than_the_robot_and_no_other(width_m: float) -> None:
    if abs(width_m - 2.0 * ROBOT_RADIUS_M) < 0.01:
        return
    walls = [[(0, 0), (6, 0)], [(6, 0), (6, 4)], [(6, 4), (0, 4)], [(0, 4), (0, 0)],
             [(3, 0), (3, 2 - width_m / 2)], [(3, 2 + width_m / 2), (3, 4)]]
    free = find_free_floor(Obstacles(np.array(walls, float)))
    assert has_way(free, Pose2(1.0, 1.0, 0.0), Pose2(5.0, 3.0, 0.0)) == (width_m > 2.0 * ROBOT_RADIUS_M)


@settings(deadline=None, max_examples=20)
@given(y0_m=st.floats(0.5, 3.5), y1_m=st.floats(0.5, 3.5), gap_m=st.floats(0.8, 2.0))
def test_the_shortest_way_is_round_the_jambs(y0_m: float, y1_m: float, gap_m: float) -> None:
    """Never shorter than the straight line, nor longer than by way of the middle of the gap, and always free."""
    walls = [[(0, 0), (6, 0)], [(6, 0), (6, 4)], [(6, 4), (0, 4)], [(0, 4), (0, 0)],
             [(3, 0), (3, 2 - gap_m / 2)], [(3, 2 + gap_m / 2), (3, 4)]]
    free = find_free_floor(Obstacles(np.array(walls, float)))
    start, goal, middle = Pose2(0.6, y0_m, 0.0), Pose2(5.4, y1_m, 0.0), Pose2(3.0, 2.0, 0.0)
    way = find_shortest_way(free, start, goal)
    assert way is not None
    length_m = float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
    assert start.distance_to(goal) - 1e-9 <= length_m <= 1.01 * (start.distance_to(middle) + middle.distance_to(goal))
    assert shapely.covers(shapely.buffer(free, 0.011), shapely.linestrings(way))


def test_where_there_is_no_way_none_is_found() -> None:
    free = find_free_floor(Obstacles(np.array([[(0, 0), (6, 0)], [(0, 4), (6, 4)], [(3, 0), (3, 4)]], float)))
    assert find_shortest_way(free, Pose2(1.0, 2.0, 0.0), Pose2(5.0, 2.0, 0.0)) is None


@pytest.mark.parametrize("leaves_way", [True, False])
def test_a_cluttered_mission_is_a_scenario_that_can_be_set_up(tmp_path: Path, leaves_way: bool) -> None:
    stage = build_stage(load_scenario(write_cluttered_mission(tmp_path, 3, leaves_way=leaves_way)))
    free = find_free_floor(stage.building.obstacles)
    assert stage.scenario.truth.extra and has_way(free, stage.start_world, stage.goal_world) == leaves_way
    again = tmp_path / "again"
    again.mkdir()
    text = write_cluttered_mission(again, 3, leaves_way=leaves_way).read_text("utf-8")
    assert text == (tmp_path / "cluttered-3.toml").read_text("utf-8")


def test_a_count_out_of_bounds_is_refused() -> None:
    with pytest.raises(ValueError, match="expected 1 to 6 things, got 7"):
        maker_of("shut-door").draw(0, count=7)
