"""The view chooser at its bounds: in which direction it looks first before a leg that begins with a turn."""

from __future__ import annotations

import math

import pytest

from knowledge_sources.plan.view_chooser import ViewChooser
from knowledge_sources.settings import DEFAULT
from world_models.entries.location import Place
from world_models.entries.task import PlanSketch, Subgoal
from world_models.files.world_files import WORLDS, load_world
from world_models.frames import Pose2

HALL, LONG_TURN, SMALL = "north-hall", DEFAULT.plan.long_turn_rad, 1e-6
HERE, LENGTH_M, TOLERANCE_M = Place(HALL, 2.0, 1.2), 1.0, 0.1


def first_direction(turn_rad: float, length_m: float = LENGTH_M, *, primitive: bool = True) -> float:
    """In which direction it looks first where the next leg leads aside by this [rad from the present heading]."""
    world = load_world(WORLDS / "two_ways.toml")
    facing = 0.7
    along = facing + turn_rad
    end = Place(HALL, HERE.x_m + length_m * math.cos(along), HERE.y_m + length_m * math.sin(along))
    leg = Subgoal(HERE, end, primitive=primitive, tolerance_m=TOLERANCE_M)
    here = HERE.in_world(world)
    pose = Pose2(here.x_m, here.y_m, facing)
    sketch = PlanSketch("Goal-1", (), HALL if primitive else "", (leg,))
    return next(ViewChooser().list_headings(world, sketch, pose)) - facing


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_before_a_long_turn_it_looks_along_the_leg_and_else_ahead(side: float) -> None:
    assert first_direction(side * (LONG_TURN - SMALL)) == 0.0
    assert first_direction(side * (LONG_TURN + SMALL)) == pytest.approx(side * (LONG_TURN + SMALL))


def test_where_there_is_nothing_to_drive_it_looks_ahead() -> None:
    assert first_direction(2.0, TOLERANCE_M - SMALL) == 0.0
    assert first_direction(2.0, TOLERANCE_M + SMALL) == pytest.approx(2.0)


def test_a_part_of_the_route_that_is_not_driven_as_it_is_tells_no_direction() -> None:
    assert first_direction(2.0, primitive=False) == 0.0
