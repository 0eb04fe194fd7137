"""One drive of Table 1: forty feet of hallway, with and without action-level servoing, by the same wheels."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from blackboard.journal import Decision
from harvey.agent import agent_of
from harvey.campaign.campaign import Task
from harvey.run_files.run_directory import RunDirectory
from harvey.run_files.run_recorder import RunRecorder
from harvey.simulation.run import SimulatedRun, head_of
from sim.stage import Stage
from sim.truth import Truth
from world_models.entries.body import MotionReport, MotorCommand
from world_models.units import FOOT_M, INCH_M

SCENARIO = "forty-foot-hallway"
INCREMENT_M = 2.0 * FOOT_M
INCREMENTS = 20
ONE_LEG = (("plan.max_leg_m", "15"),)
"""The whole way is one leg, so that no milestone corrects anything between its ends: the action level is alone."""


@dataclass(frozen=True, slots=True)
class Drive:
    """A drive to be made: of so many feet, by the wheels of a seed, stopping at each increment or not."""

    seed: int
    feet: int = 40
    continuous: bool = False


@dataclass(frozen=True, slots=True)
class Driven:
    """What came of it; z along the line and x to its right, in inches, as in the paper.

    Attributes:
        z_in, x_in: the servoed robot after each increment of two feet; on the move: when it passes where increments
            would end.
        most_in: the furthest that it was from the line anywhere on the way.
        open_z_in, open_x_in: the unservoed robot after each increment, until it touches a wall.
        way_z_in, way_x_in: the servoed robot about every foot, for the picture.
    """

    seed: int
    outcome: str
    collisions: int
    frames: int
    curvature_per_m: float
    z_in: list[float]
    x_in: list[float]
    most_in: float
    open_z_in: list[float]
    open_x_in: list[float]
    way_z_in: list[float]
    way_x_in: list[float]
    cpu_s: float


def driven(drive: Drive) -> Driven:
    """Make a drive."""
    return driven_and_kept(drive, None)


def driven_and_kept(drive: Drive, out: Path | None) -> Driven:
    """Make a drive, and keep it as a run, if ``out`` says where."""
    began_s, stage = time.process_time(), _stage(drive.feet, drive.continuous)
    head = replace(head_of(stage, drive.seed), constants=ONE_LEG)
    ends: list[Truth] = []
    agent = agent_of(head)
    files = None if out is None else RunDirectory(out)
    recorder = RunRecorder(files, head, agent.robot)
    with SimulatedRun(stage, head, agent, recorder, (_ends_of_moves(ends, lambda: run),)) as run:
        result = run.drive(files)
    body = run.simulated_body
    way = np.array([_beside(stage, truth) for truth in body.track])
    if drive.continuous:
        z_in, x_in = _passing(way, _reach(stage))
    else:
        z_in, x_in = (list(column) for column in zip(*(_beside(stage, t) for t in ends[:INCREMENTS]), strict=True))
    open_z, open_x = unservoed(drive.seed, drive.feet)
    some = way[:: max(1, len(way) // 80)]
    return Driven(
        drive.seed, result.outcome, result.collisions or 0, result.frames, body.curvature_per_m, z_in, x_in,
        float(np.max(np.abs(way[:, 1]))), open_z, open_x, some[:, 0].tolist(), some[:, 1].tolist(),
        time.process_time() - began_s,
    )


def unservoed(seed: int, feet: int = 40) -> tuple[list[float], list[float]]:
    """(z, x) of the same wheels after each increment when nobody corrects anything, until a wall is touched [in]."""
    stage = _stage(feet, False)
    body = stage.body(seed)
    places = []
    for _ in range(INCREMENTS):
        body.execute(MotorCommand(0.0, INCREMENT_M))
        if body.truth.collisions:
            break
        places.append(_beside(stage, body.truth))
    return [z for z, _ in places], [x for _, x in places]


@cache
def _stage(feet: int, continuous: bool) -> Stage:
    goal = f"(ptrans (hallway (4,4,0)) (hallway ({4 + feet},4,0)))"
    return Task(SCENARIO, (("goal", goal), ("motion.continuous", "on" if continuous else "off")), 0).stage()


def _ends_of_moves(ends: list[Truth], run: Callable[[], SimulatedRun]) -> Callable[[Decision], None]:
    """A sink that notes where the robot truly is after each MOVE."""

    def heard(decision: Decision) -> None:
        for change in decision.observed:
            if isinstance(change.entry.value, MotionReport) and change.entry.value.move_m > 0.0:
                ends.append(run().simulated_body.truth)

    return heard


def _beside(stage: Stage, truth: Truth) -> tuple[float, float]:
    """(z, x) [in] of the robot against the intended line."""
    start, goal, here = stage.start_world, stage.goal_world, truth.world_from_robot
    along = math.atan2(goal.y_m - start.y_m, goal.x_m - start.x_m)
    dx, dy = here.x_m - start.x_m, here.y_m - start.y_m
    z, left = math.cos(along) * dx + math.sin(along) * dy, math.cos(along) * dy - math.sin(along) * dx
    return z / INCH_M, -left / INCH_M


def _reach(stage: Stage) -> float:
    """What a MOVE of two feet is on the average [in]."""
    a = stage.scenario.actuator
    return (1.0 - 0.5 * (a.shortfall_low + a.shortfall_high)) * INCREMENT_M / INCH_M


def _passing(way: NDArray[np.float64], reach_in: float) -> tuple[list[float], list[float]]:
    """Where it passes the ends of increments on the move."""
    z = np.maximum.accumulate(way[:, 0])
    places = np.array([reach_in * k for k in range(1, INCREMENTS + 1) if reach_in * k <= z[-1]])
    return places.tolist(), np.interp(places, z, way[:, 1]).tolist()
