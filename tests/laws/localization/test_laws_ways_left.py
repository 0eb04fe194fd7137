"""Laws of the ways that are left of a sketch: both sides of the reach at which a thing concerns it."""

from __future__ import annotations

import pytest

from generated_boards import to_world
from harvey.testing import HALL, house, plain_robot
from knowledge_sources.methods.motion import CLEARANCES_M, meets
from knowledge_sources.methods.motion.ways_left import LEG_SLACK_M
from knowledge_sources.settings import DEFAULT
from world_models.entries import Obstacle, ObstacleStatus, Place, PlanSketch, Subgoal
from world_models.frames import Pose2

ROBOT, PLAN, SMALL, HALF_M = plain_robot(), DEFAULT.plan, 1e-4, 0.2
FROM, TO = Place(HALL, 1.5, 2.0), Place(HALL, 5.0, 2.0)


def thing(away_m: float, side: float, status: ObstacleStatus, *, touched: bool = False) -> Obstacle:
    """Something whose face is so far beside the end of the way."""
    middle = side * (away_m + HALF_M)
    corners = tuple(tuple(to_world(Pose2(TO.x_m + dx, TO.y_m + middle + dy, 0.0)).position.tolist())
                    for dx, dy in ((-HALF_M, -HALF_M), (HALF_M, -HALF_M), (HALF_M, HALF_M), (-HALF_M, HALF_M)))
    return Obstacle("hall/obstacle-1", HALL, corners, 0.02, 0.0, 0.0, 0.4, status=status, seen_s=3.0,
                    touched_s=3.0 if touched else None)


def concerns(obstacle: Obstacle, *, at: int = 0, primitive: bool = False) -> bool:
    step = Subgoal(FROM, TO, primitive)
    here = to_world(Pose2(FROM.x_m, FROM.y_m, 0.0))
    return meets(PlanSketch("Goal-1", (), HALL, (step,), at), obstacle, here, ROBOT.in_building(house()))


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("more", [-SMALL, SMALL])
def test_what_is_there_concerns_a_way_a_little_nearer_and_what_is_gone_a_little_farther_than_it_keeps_away(
    side: float, more: float
) -> None:
    """So a way that was drawn round it is neither withdrawn at once, nor kept for nothing."""
    least, most = CLEARANCES_M[-1], CLEARANCES_M[0]
    there_m, gone_m = ROBOT.radius_m + least - LEG_SLACK_M, ROBOT.radius_m + most + LEG_SLACK_M
    assert concerns(thing(there_m + more, side, "there")) == (more < 0.0)
    assert concerns(thing(there_m + more, side, "there"), primitive=True) == (more < 0.0)
    assert concerns(thing(gone_m + more, side, "gone")) == (more < 0.0)


def test_what_the_robot_stands_at_concerns_it_and_what_is_behind_it_does_not() -> None:
    assert concerns(thing(1.0, 1.0, "there", touched=True))
    assert not concerns(thing(0.0, 1.0, "there", touched=True), at=1)
    assert not concerns(thing(0.0, 1.0, "gone"), at=1)
