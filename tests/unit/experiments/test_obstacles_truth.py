"""What the truth says of obstacles and ways, on cases that one can check by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from experiments.differences.obstacles import Lacking, count_stops, find_shortest_m, judge
from experiments.trials import at_least, at_most, judge_rare, judge_share
from sim.body.collision import ROBOT_RADIUS_M, Obstacles
from world_models.frames import Pose2

ROOM = np.array([[[0, 0], [6, 0]], [[6, 0], [6, 4]], [[6, 4], [0, 4]], [[0, 4], [0, 0]]], float)
POSTER = np.array([[[1, 0.005], [2, 0.005]]])


def square(x_m: float, y_m: float, side_m: float) -> list[tuple[float, float]]:
    h = side_m / 2.0
    return [(x_m - h, y_m - h), (x_m + h, y_m - h), (x_m + h, y_m + h), (x_m - h, y_m + h)]


def segments(*things: list[tuple[float, float]]) -> np.ndarray:
    closed = [np.stack([np.array(t), np.roll(np.array(t), -1, axis=0)], axis=1) for t in things]
    return np.concatenate([ROOM, POSTER, *closed])


def test_a_box_is_lacking_and_a_poster_on_a_wall_is_not() -> None:
    lacking = Lacking.of_segments(segments(square(3, 2, 0.5)), ROOM)
    assert not lacking.is_false(square(3, 2, 0.5)) and not lacking.is_false(square(3.5, 2, 0.3))
    assert lacking.is_false(square(1.5, 0.1, 0.2)) and lacking.is_false(square(3.6, 2, 0.3))
    assert lacking.distance_m(square(4, 2, 0.5)) == pytest.approx(0.5)


def test_where_the_model_lacks_nothing_each_obstacle_is_false_and_each_stop_needless() -> None:
    lacking = Lacking.of_segments(segments(), ROOM)
    assert lacking.is_false(square(3, 2, 0.5)) and lacking.is_needless(3, 2)
    assert lacking.distance_m([(3, 2)]) == math.inf


def test_a_stop_near_a_box_has_a_reason() -> None:
    lacking = Lacking.of_segments(segments(square(3, 2, 0.5)), ROOM)
    assert not lacking.is_needless(1, 2) and lacking.is_needless(0.5, 2)


def test_looks_and_creeps_in_a_row_are_one_stop() -> None:
    assert count_stops([]) == count_stops(["go", "go"]) == 0
    assert count_stops(["look", "creep", "go", "go", "look", "look"]) == 2


def test_the_shortest_way_leads_straight_or_round_by_the_robot_s_radius() -> None:
    start, goal = Pose2(1, 2, 0), Pose2(5, 2, 0)
    assert find_shortest_m(Obstacles(segments()), start, goal) == pytest.approx(4.0, rel=0.01)
    round_m = find_shortest_m(Obstacles(segments(square(3, 2, 0.5))), start, goal)
    aside = 0.25 + ROBOT_RADIUS_M
    assert round_m is not None and 4.0 < round_m < 2.0 * math.hypot(2.0, aside) + 0.2


def test_where_a_row_of_boxes_bars_the_room_blocked_is_right() -> None:
    row = Obstacles(segments(*(square(3, y, 0.5) for y in np.arange(0.3, 4.0, 0.6))))
    shortest_m = find_shortest_m(row, Pose2(1, 2, 0), Pose2(5, 2, 0))
    assert shortest_m is None
    assert judge("blocked", shortest_m) == "blocked rightly" and judge("blocked", 4.0) == "blocked wrongly"
    assert judge("lost", None) == "lost"


def test_none_of_1000_proves_three_in_a_thousand() -> None:
    assert at_most(0, 1000) == pytest.approx(0.003, abs=1e-5)
    assert at_least(1000, 1000) == pytest.approx(0.997, abs=1e-5)
    assert at_most(3, 3) == 1.0 and at_least(0, 3) == 0.0 and at_least(0, 0) == 0.0 and at_most(0, 0) == 1.0
    assert [judge_share(n, 60, 0.95) for n in (60, 57, 56)] == ["proved", "not contradicted", "fails"]
    assert [judge_rare(n, 600, 0.01) for n in (0, 6, 7)] == ["proved", "not contradicted", "fails"]
    assert [judge_rare(n, 600, 0.0) for n in (0, 1)] == ["not contradicted", "fails"]
    with pytest.raises(ValueError, match="expected 0 to 2 of 2"):
        at_most(3, 2)
