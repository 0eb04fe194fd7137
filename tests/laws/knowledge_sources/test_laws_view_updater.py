"""Laws of the view updater: a milestone whose picture is taken is predicted again without what an obstruction hides."""

from __future__ import annotations

from dataclasses import replace

import pytest

from blackboard import Entry
from generated_boards import Bench, effect_on, reasons, to_world
from harvey.testing import check_source, plain_robot
from knowledge_sources.milestone_selector.view_predictor import ViewPredictor
from knowledge_sources.milestone_selector.view_updater import view_updater
from world_models.entries import Milestone, Obstruction
from world_models.entries.task import MilestoneStatus
from world_models.frames import Pose2

SOURCE = view_updater
AHEAD = to_world(Pose2(0.0, 0.0, 0.0)).heading_rad


def outline(left: float, right: float) -> Obstruction:
    """Something before the camera, from one column to another."""
    return Obstruction(((left, 0.0), (right, 0.0), (right, 256.0), (left, 256.0)))


def expecting() -> tuple[Bench, Entry[Milestone]]:
    """A board with a milestone as it was predicted before anything was seen before the camera."""
    bench = Bench(plain_robot())
    bench.believe()
    milestone = bench.await_milestone(look_heading_rad=AHEAD, tried=(1.0,))
    expected = effect_on(bench.ask(ViewPredictor(), milestone), Milestone)
    return bench, bench.apply(expected)[0].entry


@pytest.mark.parametrize(("left", "right"), [(0.0, 256.0), (0.0, 128.0), (128.0, 256.0)])
def test_no_line_is_expected_where_something_stands_before_the_camera(left: float, right: float) -> None:
    bench, milestone = expecting()
    hidden = bench.put(outline(left, right))
    effect = effect_on(bench.ask(SOURCE, hidden), Milestone)
    seen = effect.value
    assert effect.entry is milestone
    assert (seen.status, seen.tried, seen.look_heading_rad) == ("expected", (1.0,), milestone.value.look_heading_rad)
    assert all(not (left + 2.0 < u < right - 2.0) for line in seen.expected_px for u, _ in line)
    assert bool(seen.expected) == (right - left < 256.0)
    assert {hidden.id, milestone.id, "Hypothesis-1"} <= reasons(effect)


def test_what_is_hidden_changes_nothing_else() -> None:
    bench, milestone = expecting()
    effect = effect_on(bench.ask(SOURCE, bench.put(outline(-30.0, -20.0))), Milestone)
    assert effect.value.expected == milestone.value.expected
    assert replace(effect.value, face_colors=()) == replace(milestone.value, face_colors=())


@pytest.mark.parametrize("status", ["turning", "expected", "verified", "not testable"])
@pytest.mark.parametrize("has_belief", [True, False])
def test_only_a_milestone_whose_picture_is_taken_and_not_judged_is_predicted_again(
    status: MilestoneStatus, has_belief: bool
) -> None:
    bench = Bench(plain_robot())
    if has_belief:
        bench.believe()
    bench.await_milestone(status=status, look_heading_rad=AHEAD)
    hidden = bench.put(outline(0.0, 100.0))
    assert (bench.ask(SOURCE, hidden) is not None) == (status == "expected" and has_belief)


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench, milestone = expecting()
    check_source(SOURCE, bench, bench.put(outline(0.0, 100.0)), without=(milestone.id,))
