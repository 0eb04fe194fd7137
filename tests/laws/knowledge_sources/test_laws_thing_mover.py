"""Law of what is moved when a lost robot is found: what was seen, and not touched, since it was last sure."""

from __future__ import annotations

import cmath
from dataclasses import replace
from typing import Any, get_args

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Blackboard, Post, Revise, Revised
from harvey.testing import Bench, answer, check_source
from knowledge_sources.model.thing_mover import MAX_DRIFT_M, MAX_DRIFT_RAD, ThingMover
from knowledge_sources.settings import DEFAULT
from things_in_hall import CARTON, HALL, known_by_sight
from world_models.entries import (
    Certificate,
    Evidence,
    Hypothesis,
    MilestoneVerdict,
    Obstacle,
    ObstacleStatus,
    Place,
    diagonal,
)
from world_models.files.world_files import WORLDS, load_world
from world_models.frame_store import FrameStore
from world_models.frames import Pose2

SOURCE, S = ThingMover(), DEFAULT.action
WORLD = load_world(WORLDS / "two_ways.toml")
BELIEF = Hypothesis(HALL, Pose2(2.0, 1.2, 0.4), diagonal(0.01, 0.005), "relocalization")
PLAIN = Pose2(0.05, -0.02, 0.01)
things = st.tuples(st.sampled_from(get_args(ObstacleStatus)), st.booleans())
"""How it is known, and whether it was touched."""
verdicts = st.sampled_from(get_args(MilestoneVerdict))
corrections = st.builds(Pose2, st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))


def thing(status: ObstacleStatus = "there", *, is_touched: bool = False, number: int = 1) -> Obstacle:
    return Obstacle(f"{HALL}/obstacle-{number}", HALL, CARTON, 0.05, 0.0, 0.0, 0.5, certainty=0.9,
                    touched_s=1.0 if is_touched else None, status=status)


def open_hall() -> Blackboard:
    """A board with the frames of the hall and of what is next to it."""
    board, store = Blackboard(), FrameStore(WORLD)
    frames = [Post(store.frame(name)) for name in ("", HALL, "reception", "archive")]
    board.apply(frames, author="test", cycle=0)
    return board


@given(st.lists(things | verdicts, max_size=8))
@settings(max_examples=60, deadline=None)
def test_it_moves_what_was_seen_since_it_was_sure_and_was_not_touched(drawn: list[Any]) -> None:
    board, expected, sure = open_hall(), list[Any](), list[Any]()
    for cycle, one in enumerate(drawn, 1):
        is_thing = isinstance(one, tuple)
        value: Any = thing(one[0], is_touched=one[1], number=cycle) if is_thing else Certificate(
            "Milestone-1", "", one, "so it was", 9, 9, 9, 1.0, 0.2, 0.0, 0.0, 0.0, 4.0, 1e-3, 1e-3, 0.006)
        (change,) = board.apply([Post(value)], author="test", cycle=cycle)
        if is_thing and one[0] != "gone" and not one[1]:
            expected.append(change.entry)
        elif one == "verified":
            expected, sure = [], [change.entry]
    (found,) = board.apply([Post(replace(BELIEF, correction=PLAIN))], author="test", cycle=99)
    effects = answer(SOURCE, board.view, Revised(found.entry))
    assert (effects is not None) == bool(expected)
    assert [effect.entry for effect in effects or () if isinstance(effect, Revise)] == expected
    assert all(list(effect.because) == [found.entry, effect.entry, *sure] for effect in effects or ())


def find(by: Pose2) -> Obstacle:
    """A thing that is there, after the belief was corrected."""
    board, known = open_hall(), known_by_sight(thing())
    board.apply([Post(thing()), Post(known)], author="test", cycle=1)
    (found,) = board.apply([Post(replace(BELIEF, correction=by))], author="test", cycle=2)
    *told, effect = answer(SOURCE, board.view, Revised(found.entry)) or ()
    assert isinstance(effect, Revise) and all(isinstance(one.value, Evidence) for one in told)
    return effect.value


@given(corrections)
@settings(max_examples=40, deadline=None)
def test_as_seen_from_the_robot_it_stays_where_it_was(by: Pose2) -> None:
    """Recomputed with complex numbers; and its place is less sure by half of what the belief was off."""
    moved, here = find(by), BELIEF.world_from_robot(WORLD)
    now, turned = complex(here.x_m, here.y_m), cmath.exp(1j * here.heading_rad)
    before_turned = turned * cmath.exp(-1j * by.heading_rad)
    before = now - before_turned * complex(by.x_m, by.y_m)
    for (x0, y0), (x1, y1) in zip(CARTON, moved.footprint, strict=True):
        as_seen = (complex(x0, y0) - before) / before_turned
        assert abs((complex(x1, y1) - now) / turned - as_seen) < 2e-3
    middle = shapely.Polygon(moved.footprint).centroid  # all of it moves, also where it is said to be
    at = Place(moved.locale, moved.x_m, moved.y_m).in_world(WORLD)
    assert (at.x_m, at.y_m) == pytest.approx((middle.x, middle.y), abs=2e-3)
    assert moved.certainty == 0.9 and moved.status == "there"
    assert moved.sigma_m == pytest.approx(float(np.hypot(0.05, 0.5 * np.hypot(by.x_m, by.y_m))), abs=1e-4)


@pytest.mark.parametrize(("by", "is_carried"), [
    (Pose2(MAX_DRIFT_M - 1e-6, 0.0, 0.0), False), (Pose2(0.0, MAX_DRIFT_M + 1e-6, 0.0), True),
    (Pose2(0.0, 0.0, MAX_DRIFT_RAD - 1e-6), False), (Pose2(0.0, 0.0, -MAX_DRIFT_RAD - 1e-6), True)])
def test_what_was_seen_by_who_was_carried_off_stays_and_is_believed_less(by: Pose2, is_carried: bool) -> None:
    now = find(by)
    assert (now.footprint == CARTON) is is_carried
    assert now.certainty == pytest.approx(9.0 / 14.5 if is_carried else 0.9)  # half as likely elsewhere
    assert now.status == ("suspected" if is_carried else "there")


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench()
    bench.board = open_hall()
    known = bench.put(thing())
    found = bench.put(replace(BELIEF, correction=PLAIN))
    check_source(SOURCE, bench, Revised(found), without=(known.id,))
