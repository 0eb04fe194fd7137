"""Laws of telling a place from those at which its room repeats itself."""

import math
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from knowledge_sources.methods.lookalikes import hardest_to_tell, margin, view
from world_models.actuator import ActuatorModel
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2
from world_models.robot import RobotModel
from world_models.store import WORLDS, load_world

Floats = NDArray[np.float64]

WORLD = load_world(WORLDS / "research_center.toml", details=[])
ROBOT = RobotModel(WORLD, Camera.from_field_of_view(math.radians(65.0)), CameraMount(1.0, 0.1), ActuatorModel())
NONE = np.zeros((0, 2, 2))
few = settings(max_examples=40, deadline=None)


@st.composite
def segments(draw: st.DrawFn) -> Floats:
    """(n, 2, 2) of 15 px and more."""
    n = draw(st.integers(0, 12))
    middles = draw(hnp.arrays(float, (n, 2), elements=st.floats(60.0, 450.0)))
    angles = draw(hnp.arrays(float, n, elements=st.floats(0.0, math.pi)))
    halves = draw(hnp.arrays(float, n, elements=st.floats(7.5, 50.0)))
    along = halves[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    return np.stack([middles - along, middles + along], axis=1)


@few
@given(segments(), segments(), segments())
def test_what_speaks_for_one_speaks_against_the_other(one: Floats, other: Floats, seen: Floats) -> None:
    assert margin(one, other, seen) == pytest.approx(-margin(other, one, seen), abs=1e-9)


@few
@given(segments(), segments(), segments(), st.randoms(use_true_random=False))
def test_the_order_of_lines_and_segments_does_not_matter(
    one: Floats, other: Floats, seen: Floats, random: Random
) -> None:
    def mixed(lines: Floats) -> Floats:
        order = list(range(len(lines)))
        random.shuffle(order)
        return lines[order]

    assert margin(mixed(one), mixed(other), mixed(seen)) == pytest.approx(margin(one, other, seen), abs=1e-9)


@few
@given(segments(), segments())
def test_the_same_view_from_two_places_tells_nothing(one: Floats, seen: Floats) -> None:
    assert margin(one, one, seen) == pytest.approx(0.0, abs=1e-9)


@few
@given(segments())
def test_what_only_one_view_shows_speaks_for_it_where_it_is_seen_and_against_it_where_not(one: Floats) -> None:
    half = 0.5 * float(np.sum(np.minimum(np.linalg.norm(one[:, 1] - one[:, 0], axis=1), 100.0) / 30.0))
    assert margin(one, NONE, one) == pytest.approx(half, abs=1e-9)
    assert margin(one, NONE, NONE) == pytest.approx(-half, abs=1e-9)


def test_from_the_middle_of_the_hallway_the_other_way_round_is_told() -> None:
    """What should be seen in one direction is not what should be seen from where the hallway repeats itself."""
    here = Pose2(*WORLD.world_from_locale("hallway").apply([6.0, 1.2, 0.0])[:2], 0.0)
    seen = view(ROBOT, here).segments_px
    found = hardest_to_tell(ROBOT, seen, "hallway", here)
    assert found is not None and found.margin > 1.0
    from_there = hardest_to_tell(ROBOT, view(ROBOT, found.world_from_robot).segments_px, "hallway", here)
    assert from_there is not None and from_there.margin < 0.0
