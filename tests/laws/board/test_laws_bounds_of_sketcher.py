"""The milestone passer at its bounds: when a subgoal is repeated, and what follows when that was in vain."""

from __future__ import annotations

from dataclasses import replace

import pytest

from acting import answer
from blackboard.board import Blackboard
from blackboard.change import Change
from blackboard.effect import Effect, Post, Revise
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from harvey.simulation.simulated_run import build_robot_model
from knowledge_sources.plan.milestone_passer import MilestonePasser
from knowledge_sources.settings import DEFAULT
from sim.scenario import load_scenario
from world_models.entries.location import Hypothesis, Place, diagonal
from world_models.entries.task import Goal, Impasse, Milestone, PlanSketch, Subgoal
from world_models.files.world_files import WORLDS, load_world
from world_models.frame_store import FrameStore
from world_models.frames import Pose2

HALL = "north-hall"
FROM, TO = Place(HALL, 2.0, 1.2), Place(HALL, 4.0, 1.2)
MOST, TOLERANCE_M = DEFAULT.plan.max_adjustments, 0.1
SMALL = 1e-3


def decide(off_m: float, adjustments: int, earlier_goals: int = 0) -> Effect:
    """What it does when the milestone at the end of a subgoal is verified, so far from where it should be."""
    world, board = load_world(WORLDS / "two_ways.toml"), Blackboard()
    store, robot = FrameStore(world), build_robot_model(load_scenario("shut-door"), world)
    cycle = 0

    def apply(*effects: Effect) -> tuple[Change, ...]:
        nonlocal cycle
        cycle += 1
        return board.apply(effects, author="test", cycle=cycle)

    apply(*map(Post, robot.entries()), *(Post(store.frame(name)) for name in ("", HALL, "reception", "archive")),
          Post(Hypothesis(HALL, Pose2(TO.x_m - off_m, TO.y_m, 0.0), diagonal(0.01, 0.005), "milestone")))
    for _ in range(earlier_goals):
        (old,) = apply(Post(Goal(FROM, TO)))
        apply(Revise(old.entry, replace(old.entry.value, status="abandoned")))
    (goal,) = apply(Post(Goal(FROM, TO)))
    way = Subgoal(FROM, TO, primitive=True, tolerance_m=TOLERANCE_M)
    (sketch,) = apply(Post(PlanSketch(goal.entry.id, (), "", (way,), at=1, adjustments=adjustments)))
    (expected,) = apply(Post(Milestone(sketch.entry.id, 1, "the end", 0.0)))
    (verified,) = apply(Revise(expected.entry, replace(expected.entry.value, status="verified")))
    effects = answer(MilestonePasser(DEFAULT), board.view, verified)
    assert effects is not None
    return effects[0]


@pytest.mark.parametrize(("off_m", "is_repeated"), [(TOLERANCE_M - SMALL, False), (TOLERANCE_M + SMALL, True)])
def test_a_subgoal_is_repeated_beyond_its_tolerance(off_m: float, is_repeated: bool) -> None:
    effect = decide(off_m, 0)
    assert isinstance(effect, Revise) and isinstance(effect.value, PlanSketch)
    assert (effect.value.adjustments == 1, effect.value.status == "done") == (is_repeated, not is_repeated)


def test_in_vain_is_doubt_for_the_first_goal_and_blocked_for_a_later_one() -> None:
    last = decide(0.5, MOST - 1)
    assert isinstance(last, Revise) and isinstance(last.value, PlanSketch) and last.value.adjustments == MOST
    doubt, blocked = decide(0.5, MOST), decide(0.5, MOST, earlier_goals=1)
    assert isinstance(doubt, Post) and isinstance(doubt.value, Discrepancy) and doubt.value.level is Level.GOAL
    assert isinstance(blocked, Post) and isinstance(blocked.value, Impasse) and blocked.value.kind == "blocked"
