"""Laws of plan sketches in made-up houses: none passes a barrier, and refinement changes nothing that is verified."""

import math
from itertools import pairwise

import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Decision, Post, Quiescence
from box_rooms import barriers, generate_house
from harvey.dry_run import build_dry_run
from world_models.actuator import ActuatorModel
from world_models.building.world import World
from world_models.camera import Camera, CameraMount
from world_models.entries import Command, Outcome, PlanSketch, Subgoal, diagonal
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world
from world_models.robot import RobotModel
from world_models.units import FOOT_M

CAMERA, MOUNT = Camera.from_field_of_view(math.radians(65.0), 256, 256), CameraMount(1.0, 0.1)


def plan_sketches(world: World) -> tuple[list[PlanSketch], Outcome]:
    """Every revision of every sketch of a mission from the first room to the last, in order, and how it ended."""
    sketches: list[PlanSketch] = []

    def note(decision: Decision) -> None:
        sketches.extend(c.entry.value for c in decision.made if isinstance(c.entry.value, PlanSketch))

    robot = RobotModel(world, CAMERA, MOUNT, ActuatorModel())
    scheduler = build_dry_run(world, robot, sinks=(note,))
    ends = [world.locale(name).outline.mean(axis=0) / FOOT_M * part
            for name, part in ((world.rooms[0], 0.35), (world.rooms[-1], 0.35))]
    first, last = (f"({room} ({x:.2f},{y:.2f},0))" for room, (x, y) in
                   zip((world.rooms[0], world.rooms[-1]), ends, strict=True))
    scheduler.post([Post(Command(f"(ptrans {first} {last})", 0.5, None, diagonal(0.003, 0.001)))], "user")
    while scheduler.view.latest(Outcome) is None and scheduler.cycle < 4_000:
        if scheduler.step() is None:
            scheduler.post([Post(Quiescence(scheduler.cycle))], "scheduler")
    outcome = scheduler.view.latest(Outcome)
    return sketches, outcome.value if outcome else Outcome("failed", "no end")


def way_of(world: World, subgoal: Subgoal) -> shapely.LineString:
    ends = [place.in_world(world).position for place in (subgoal.origin, subgoal.destination)]
    return shapely.LineString(ends)


@settings(deadline=None, max_examples=5)
@given(st.integers(0, 100_000))
def test_sketches_keep_clear_of_barriers_and_keep_what_is_verified(seed: int) -> None:
    world = read_world(Source.parse(generate_house(np.random.default_rng(seed)), "house.toml"))
    sketches, outcome = plan_sketches(world)
    assert outcome.kind in ("reached", "blocked"), outcome
    solid = barriers(world, world.rooms)
    for sketch in sketches:
        for subgoal in sketch.subgoals:
            if subgoal.primitive:
                assert not way_of(world, subgoal).intersects(solid), f"{subgoal} passes a barrier"
        for one, other in pairwise(sketch.subgoals):
            assert one.destination.locale == other.origin.locale
    for before, after in consecutive_revisions(sketches):
        done = min(before.at, after.at)
        assert before.subgoals[:done] == after.subgoals[:done]
        assert after.at >= before.at or after.adjustments == before.adjustments + 1
        assert before.status == "active"


def consecutive_revisions(sketches: list[PlanSketch]) -> list[tuple[PlanSketch, PlanSketch]]:
    """Successive revisions of the same sketch: the same place in the tree and the same number of subgoals."""
    latest: dict[tuple[object, ...], PlanSketch] = {}
    pairs = []
    for sketch in sketches:
        key = sketch.goal, sketch.path
        before = latest.get(key)
        if before is not None and before.is_active:
            pairs.append((before, sketch))
        latest[key] = sketch
    return pairs
