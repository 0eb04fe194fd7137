"""Laws of what people hide: what is behind them is not asked of a picture, and the rest is as it was."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from blackboard import Entry
from generated_boards import Bench, effect_on, to_world
from harvey.testing import HALL, check_source, plain_robot
from harvey_people.behaving.people_entries import PeopleHide
from harvey_people.seeing.mover import Mover
from harvey_people.seeing.people_masker import PeopleMasker
from harvey_people.seeing.silhouette import outline
from knowledge_sources.milestone_selector.view_predictor import ViewPredictor
from world_models.entries import CameraPicture, Milestone, Segments
from world_models.frames import Pose2

ROBOT, BELIEF, NOW_S = plain_robot(), Pose2(2.0, 1.6, 0.15), 10.0
SHARP = tuple(tuple(1e-4 if i == j else 0.0 for j in range(4)) for i in range(4))
HERE = to_world(BELIEF)


def person(ahead_m: float, left_m: float, **fields: Any) -> Mover:
    """Who stands there, as the robot sees it."""
    there = HERE @ Pose2(ahead_m, left_m, 0.0)
    one = Mover("mover-1", HALL, there.x_m, there.y_m, 0.0, 0.0, SHARP, there.x_m, there.y_m, 0.2, -7.0, NOW_S, NOW_S,
                5, "a law", "may move")
    return replace(one, **fields)


def look(*people: Mover) -> tuple[Bench, Entry[Segments], Entry[Milestone]]:
    """A board with a milestone, and the segments of its picture."""
    bench = Bench(ROBOT)
    bench.believe(BELIEF)
    for one in people:
        bench.put(one)
    milestone = bench.await_milestone(look_heading_rad=HERE.heading_rad)
    expected = bench.apply(effect_on(bench.ask(ViewPredictor(), milestone), Milestone))[0].entry
    picture = bench.put(CameraPicture(b"", 0, NOW_S, purpose="milestone"))
    seen = np.array(expected.value.expected_px)
    return bench, bench.put(Segments(picture.id, expected.id, seen, np.full(len(seen), 0.3), 40.0)), expected


@pytest.mark.parametrize(("ahead_m", "left_m"), [(1.0, 0.0), (1.5, 0.3), (2.0, -0.3)])
def test_what_is_behind_somebody_is_not_asked_and_the_rest_is_as_it_was(ahead_m: float, left_m: float) -> None:
    one = person(ahead_m, left_m)
    bench, segments, milestone = look(one)
    told, revised = check_source(PeopleMasker, bench, segments)
    before, left = milestone.value, revised.value
    assert isinstance(told.value, PeopleHide) and "hidden by mover-1" in told.value.sentence()
    assert len(left.expected) == len(before.expected) - told.value.hidden < len(before.expected)
    assert len(left.expected) == len(left.expected_px) == len(left.landmark_of)
    hides = outline(ROBOT, HERE, one, NOW_S)
    assert hides is not None
    for line, pixels in zip(before.expected, before.expected_px, strict=True):
        assert (line in left.expected) is bool(hides.shows(np.array(pixels))[0])
    assert sum(len(points) for _, points in left.face_colors) < sum(len(points) for _, points in before.face_colors)
    assert left.status == "expected" and left.what == before.what


@pytest.mark.parametrize("one", [
    person(-2.0, 0.0),                          # behind the robot
    person(1.5, 6.0),                           # far to the side
    person(1.5, 0.0, status="gone"),            # has gone
    person(1.5, 0.0, seen_s=NOW_S - 4.0),       # was seen too long ago
])
def test_who_stands_elsewhere_hides_nothing(one: Mover) -> None:
    bench, segments, _ = look(one)
    assert bench.ask(PeopleMasker(), segments) is None


def test_the_outline_is_where_the_figure_is_and_wider_with_its_doubt() -> None:
    """Somebody 2 m ahead is in the middle of the picture; to the left one is left; doubt makes it wider."""
    spans = []
    for one in (person(2.0, 0.0), person(2.0, 0.5), person(2.0, 0.0, seen_s=NOW_S, at_s=NOW_S - 1.0, vx_m_per_s=0.0)):
        found = outline(ROBOT, HERE, one, NOW_S)
        assert found is not None
        us = np.array(found.outline_px)[:, 0]
        spans.append((us.min(), us.max()))
    middle = ROBOT.camera.cx
    assert math.isclose(sum(spans[0]) / 2.0, middle, abs_tol=4.0)
    assert sum(spans[1]) / 2.0 < middle - 40.0
    assert spans[2][1] - spans[2][0] > spans[0][1] - spans[0][0] + 10.0
