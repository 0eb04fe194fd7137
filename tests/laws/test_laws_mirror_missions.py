"""Mirror law and frame law of whole missions: what is decided is mirrored with the building, and turned with it.

In a dry run, in which every milestone is verified: all that plans, chooses views and drives. The house of the kit is
alike on both sides but for what stands in it, and so its own mirror image with that on the other side. In these
missions the view ahead is good: where none is, those all round are tried, on the left first in either house.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import pytest

from blackboard import Decision, Post, Quiescence, Retracted
from generated_boards import WIDTH_M
from harvey.dry_run import build_dry_run
from harvey.testing import HALL, HOUSE, STUDY, plain_robot
from knowledge_sources.settings import DEFAULT
from world_models.actuator import ActuatorModel
from world_models.building.world import World
from world_models.entries import Command, Hypothesis, Leg, Milestone, MotorCommand, Outcome, Place, PlanSketch, diagonal
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world
from world_models.frames import Pose2, wrap_angle
from world_models.units import FOOT_M

WITHIN_M, WITHIN_RAD = 1e-3, 1e-3
MAX_CYCLES = 3000
BLIND = replace(DEFAULT, action=replace(DEFAULT.action, keeps_to_seen_floor=False))
"""Without looks at the floor: which of them is best is found by samples, and often two are as good."""
ODD = ActuatorModel(increment_m=0.593, turn_increment_rad=0.2711)
"""Increments that no look and no leg is a multiple of: it is rounding that would divide them by one more or less."""


ON_WALLS = [f'["{kind}", "{wall}", {along}]' for kind, walls, alongs in (
    ("picture", ("north", "south"), (1.1, 4.1)), ("notice-board", ("north", "south"), (2.6, 5.2)),
    ("picture", ("east", "west"), (0.7, 3.3))) for wall in walls for along in alongs]
"""Alike on both sides of a room, that the robot has something to look at."""


class Mission(NamedTuple):
    """From where to where, with what stands in the hall (kind, x, y, degrees); all in the locales' frames."""

    start: Pose2
    goal: Place
    things: tuple[tuple[str, float, float, float], ...]

    def mirrored(self) -> Mission:
        """The same on the other side: of hall and study the middle line is the same."""
        s, g = self.start, self.goal
        heading = None if g.heading_rad is None else -g.heading_rad
        return Mission(Pose2(s.x_m, WIDTH_M - s.y_m, -s.heading_rad),
                       Place(g.locale, g.x_m, WIDTH_M - g.y_m, heading),
                       tuple((kind, x, WIDTH_M - y, 180.0 - turn) for kind, x, y, turn in self.things))


def build(mission: Mission, at: tuple[float, float] = (3.0, -2.0), turn_deg: float = 30.0) -> World:
    """The house of the kit where it stands, with what stands in its hall."""
    things = ", ".join([*ON_WALLS, *(f'["{kind}", [{x!r}, {y!r}, {turn!r}]]' for kind, x, y, turn in mission.things)])
    text = HOUSE.replace("at = [3, -2]\nturn = 30", f"at = [{at[0]!r}, {at[1]!r}]\nturn = {turn_deg!r}")
    text = text.replace("size = [6, 4]", f"size = [6, 4]\nthings = [{', '.join(ON_WALLS)}]")
    return read_world(Source.parse(text.replace("size = [8, 4]", f"size = [8, 4]\nthings = [{things}]"), "house.toml"))


def decide(mission: Mission, world: World) -> list[tuple[str, tuple[float, ...], tuple[float, ...]]]:
    """Each decision: whose it is and what it makes, in words; and its numbers: across and angles, and all others.

    Places are told in the hall's frame.
    """
    told: list[Any] = []
    hall = world.world_from_locale(HALL)
    yaw = math.atan2(hall.rotation[1, 0], hall.rotation[0, 0])

    def place(x: float, y: float, heading: float = 0.0) -> tuple[float, float, float]:
        at = hall.inverse().apply((x, y, 0.0))
        return float(at[0]), float(at[1]) - 0.5 * WIDTH_M, wrap_angle(heading - yaw)

    def describe(value: Any) -> tuple[str, tuple[float, ...], tuple[float, ...]]:
        name = type(value).__name__
        if isinstance(value, Hypothesis):
            pose = value.world_from_robot(world)
            x, across, heading = place(pose.x_m, pose.y_m, pose.heading_rad)
            return f"{name} {value.locale} {value.basis} {value.status}", (across, heading), (x,)
        if isinstance(value, MotorCommand):
            return name, (value.turn_rad,), (value.move_m,)
        if isinstance(value, Milestone):
            heading = wrap_angle(value.look_heading_rad - yaw)
            return f"{name} {value.index} {value.what} {value.status}", (heading,), ()
        if isinstance(value, Leg):
            ends = place(value.x0_m, value.y0_m), place(value.x1_m, value.y1_m)
            return f"{name} {value.status}", (ends[0][1], ends[1][1]), (ends[0][0], ends[1][0], value.tolerance_m)
        if isinstance(value, PlanSketch):
            ends = [place(*p.in_world(world).position) for s in value.subgoals for p in (s.origin, s.destination)]
            steps = " ".join(f"{s.destination.locale} {s.passage} {s.primitive}" for s in value.subgoals)
            said = f"{name} {value.path} {value.at} {value.verified} {value.status}: {steps}"
            return said, tuple(e[1] for e in ends), tuple(e[0] for e in ends)
        return name, (), ()

    def note(decision: Decision) -> None:
        source = "" if decision.chosen is None else decision.chosen.source.name
        for change in decision.made:
            said, odd, even = describe(change.entry.value)
            told.append((f"{source}: {'ends ' * isinstance(change, Retracted)}{said}", odd, even))

    scheduler = build_dry_run(world, plain_robot(world, actuator=ODD), BLIND, sinks=(note,))
    start, goal = mission.start, mission.goal
    command = f"(ptrans ({HALL} ({start.x_m / FOOT_M!r},{start.y_m / FOOT_M!r},0))" \
        f" ({goal.locale} ({goal.x_m / FOOT_M!r},{goal.y_m / FOOT_M!r},0)))"
    scheduler.post([Post(Command(command, mission.start.heading_rad, None, diagonal(0.003, 0.001)))], "user")
    while scheduler.view.latest(Outcome) is None and scheduler.cycle < MAX_CYCLES:
        if scheduler.step() is None:
            scheduler.post([Post(Quiescence(scheduler.cycle))], "scheduler")
    outcome = scheduler.view.latest(Outcome)
    assert outcome is not None and outcome.value.kind == "reached"
    return told


MISSIONS = (
    Mission(Pose2(1.23, 1.31, 0.4), Place(STUDY, 2.53, 1.62), ()),
    Mission(Pose2(1.21, 2.43, 0.5), Place(HALL, 6.87, 1.13), (("table", 4.03, 1.37, 0.0),)),
    Mission(Pose2(6.04, 3.11, -1.0), Place(STUDY, 4.53, 1.22),
            (("table", 4.01, 2.63, 20.0), ("table", 2.02, 0.74, 90.0))),
)


@pytest.fixture(scope="module", params=MISSIONS, ids=lambda m: m.goal.locale)
def mission(request: pytest.FixtureRequest) -> tuple[Mission, list[Any]]:
    """A mission, and its decisions."""
    return request.param, decide(request.param, build(request.param))


def compare(one: list[Any], other: list[Any], sign: float) -> None:
    """The same sources, kinds and words in the same order; numbers across and angles have a sign."""
    assert [said for said, _, _ in one] == [said for said, _, _ in other]
    for (said, odd, even), (_, odd_there, even_there) in zip(one, other, strict=True):
        assert even_there == pytest.approx(even, abs=WITHIN_M), said
        off = [math.remainder(a - sign * b, math.tau) for a, b in zip(odd_there, odd, strict=True)]
        assert off == pytest.approx([0.0] * len(off), abs=WITHIN_RAD), said


def test_what_is_decided_in_the_mirrored_house_is_mirrored(mission: tuple[Mission, list[Any]]) -> None:
    plain, decided = mission
    compare(decided, decide(plain.mirrored(), build(plain.mirrored())), -1.0)
    assert len(decided) > 50


@pytest.mark.parametrize(("at", "turn_deg"), [((-40.0, 17.0), 30.0), ((3.0, -2.0), -141.0), ((12.0, 5.0), 90.0)])
def test_what_is_decided_in_the_house_elsewhere_is_the_same_in_its_own_frame(
    mission: tuple[Mission, list[Any]], at: tuple[float, float], turn_deg: float
) -> None:
    plain, decided = mission
    compare(decided, decide(plain, build(plain, at, turn_deg)), 1.0)
