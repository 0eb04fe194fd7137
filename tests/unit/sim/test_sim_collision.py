"""What is solid, and the score of a run."""

from __future__ import annotations

import math

import numpy as np
import pytest

from box_rooms import box_faces
from experiments.generated.scenes import Patch, PatchFace
from sim.body.collision import Obstacles
from sim.truth import Truth, cross_track_m, score
from world_models.frames import Pose2


def test_clearance_of_a_wall_is_the_distance_less_the_radius() -> None:
    wall = Patch("wall", [(2.0, 1.0, 0.0), (2.0, -1.0, 0.0), (2.0, -1.0, 2.5), (2.0, 1.0, 2.5)])
    obstacles = Obstacles.of_faces([PatchFace((wall,))])
    assert obstacles.clearance_m(Pose2(0.0, 0.0, 0.0)) == pytest.approx(2.0 - 0.35)
    assert obstacles.clearance_m(Pose2(2.0, 2.0, 0.0)) == pytest.approx(1.0 - 0.35)


@pytest.mark.parametrize(("low", "high", "solid"), [((0.0, 0.02), (1.0, 1.0), False), ((2.1, 2.5), (1.0, 1.0), False),
                                                    ((0.7, 0.75), (1.0, 1.0), True), ((0.0, 2.5), (1.0, 1.0), True)])
def test_only_what_reaches_between_wheel_and_top_is_in_the_way(
    low: tuple[float, float], high: tuple[float, float], solid: bool
) -> None:
    box = box_faces((0.0, 0.0, low[0]), (*high, low[1]), "box")
    near = Obstacles.of_faces(box).clearance_m(Pose2(0.5, -0.2, 0.0))
    assert (near == pytest.approx(0.2 - 0.35)) if solid else math.isinf(near)


def test_touching_blocks_steps_in_and_frees_steps_out() -> None:
    wall = Patch("wall", [(1.0, 1.0, 0.0), (1.0, -1.0, 0.0), (1.0, -1.0, 2.5), (1.0, 1.0, 2.5)])
    obstacles = Obstacles.of_faces([PatchFace((wall,))])
    here = Pose2(0.70, 0.0, 0.0)
    assert obstacles.blocks(here, Pose2(0.71, 0.0, 0.0)) and not obstacles.blocks(here, Pose2(0.69, 0.0, 0.0))


def test_the_score_compares_the_last_truth_with_the_goal() -> None:
    track = [Truth(Pose2(0.0, 0.0, 0.0)), Truth(Pose2(2.0, 0.3, 0.0)),
             Truth(Pose2(4.02, -0.01, 0.1), time_s=9.0, path_m=4.2, collisions=1)]
    result = score(track, Pose2(0.0, 0.0, 0.0), Pose2(4.0, 0.0, 0.0), heading_matters=True)
    assert (result.error_x_m, result.error_y_m) == pytest.approx((0.02, -0.01))
    assert result.position_error_m == pytest.approx(math.hypot(0.02, 0.01))
    assert result.heading_error_rad == pytest.approx(0.1)
    assert (result.max_cross_track_m, result.collisions, result.path_m) == (0.3, 1, 4.2)
    with pytest.raises(ValueError, match="at least one"):
        score([], Pose2(0, 0, 0), Pose2(0, 0, 0))


def test_cross_track_is_positive_to_the_left() -> None:
    assert cross_track_m(Pose2(1.0, 0.5, 0.0), Pose2(0, 0, 0), Pose2(2, 0, 0)) == pytest.approx(0.5)
    assert np.sign(cross_track_m(Pose2(1.0, 0.5, 0.0), Pose2(2, 0, 0), Pose2(0, 0, 0))) == -1
