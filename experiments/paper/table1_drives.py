"""One drive of Table 1: forty feet of hallway, with and without action-level servoing, on the same wheels."""

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
from harvey.agent import build_agent
from harvey.campaign.campaign import Task
from harvey.simulation.run import SimulatedRun, build_head
from logs.run_directory import RunDirectory
from logs.run_recorder import RunRecorder
from sim.stage import Stage
from sim.truth import Truth
from world_models.entries.body import MotionReport, MotorCommand
from world_models.units import FOOT_M, INCH_M

SCENARIO = "forty-foot-hallway"
INCREMENT_M = 2.0 * FOOT_M
INCREMENTS = 20
ONE_LEG = (("plan.max_leg_m", "15"),)
"""The whole path is one leg, so that no milestone corrects anything between its ends."""


@dataclass(frozen=True, slots=True)
class Drive:
    """A drive: length in feet, seed of the wheels, and whether it stops after each increment."""

    seed: int
    feet: int = 40
    continuous: bool = False


@dataclass(frozen=True, slots=True)
class DriveResult:
    """Result of a drive; z along the line and x to its right, in inches, as in the paper.

    Attributes:
        z_in, x_in: the servoed robot after each increment of two feet; on the move: where increments would end.
        max_in: its largest distance from the line on the whole path.
        open_z_in, open_x_in: the unservoed robot after each increment, until it touches a wall.
        path_z_in, path_x_in: the servoed robot about every half foot, for the picture.
    """

    seed: int
    outcome: str
    collisions: int
    frames: int
    curvature_per_m: float
    z_in: list[float]
    x_in: list[float]
    max_in: float
    open_z_in: list[float]
    open_x_in: list[float]
    path_z_in: list[float]
    path_x_in: list[float]
    cpu_s: float


def run_drive(drive: Drive, out: Path | None = None) -> DriveResult:
    """Drive, and keep the run in ``out``, if given."""
    began_s, stage = time.process_time(), _stage(drive.feet, drive.continuous)
    head = replace(build_head(stage, drive.seed), constants=ONE_LEG)
    ends: list[Truth] = []
    agent = build_agent(head)
    files = None if out is None else RunDirectory(out)
    recorder = RunRecorder(files, head, agent.world, agent.robot)
    with SimulatedRun(stage, head, agent, recorder, (_log_ends_of_moves(ends, lambda: run),)) as run:
        result = run.drive(files)
    body = run.simulated_body
    way = np.array([_to_line_in(stage, truth) for truth in body.track])
    if drive.continuous:
        z_in, x_in = _interpolate_ends(way, _compute_mean_move_in(stage))
    else:
        z_in, x_in = (list(column) for column in zip(*(_to_line_in(stage, t) for t in ends[:INCREMENTS]), strict=True))
    open_z, open_x = run_open_loop(drive.seed, drive.feet)
    some = way[:: max(1, len(way) // 80)]
    return DriveResult(
        drive.seed, result.outcome, result.collisions or 0, result.frames, body.curvature_per_m, z_in, x_in,
        float(np.max(np.abs(way[:, 1]))), open_z, open_x, some[:, 0].tolist(), some[:, 1].tolist(),
        time.process_time() - began_s,
    )


def run_open_loop(seed: int, feet: int = 40) -> tuple[list[float], list[float]]:
    """Drive the same wheels without corrections; (z, x) [in] after each increment, until a wall is touched."""
    stage = _stage(feet, False)
    body = stage.body(seed)
    places = []
    for _ in range(INCREMENTS):
        body.execute(MotorCommand(0.0, INCREMENT_M))
        if body.truth.collisions:
            break
        places.append(_to_line_in(stage, body.truth))
    return [z for z, _ in places], [x for _, x in places]


@cache
def _stage(feet: int, continuous: bool) -> Stage:
    goal = f"(ptrans (hallway (4,4,0)) (hallway ({4 + feet},4,0)))"
    return Task(SCENARIO, (("goal", goal), ("motion.continuous", "on" if continuous else "off")), 0).stage()


def _log_ends_of_moves(ends: list[Truth], run: Callable[[], SimulatedRun]) -> Callable[[Decision], None]:
    """Make a sink that appends the truth after each MOVE."""

    def sink(decision: Decision) -> None:
        for change in decision.observed:
            if isinstance(change.entry.value, MotionReport) and change.entry.value.move_m > 0.0:
                ends.append(run().simulated_body.truth)

    return sink


def _to_line_in(stage: Stage, truth: Truth) -> tuple[float, float]:
    """Convert the true pose to (z, x) [in] of the intended line."""
    start, goal, here = stage.start_world, stage.goal_world, truth.world_from_robot
    along = math.atan2(goal.y_m - start.y_m, goal.x_m - start.x_m)
    dx, dy = here.x_m - start.x_m, here.y_m - start.y_m
    z, left = math.cos(along) * dx + math.sin(along) * dy, math.cos(along) * dy - math.sin(along) * dx
    return z / INCH_M, -left / INCH_M


def _compute_mean_move_in(stage: Stage) -> float:
    """Mean length of a commanded MOVE of two feet [in]."""
    a = stage.scenario.actuator
    return (1.0 - 0.5 * (a.shortfall_low + a.shortfall_high)) * INCREMENT_M / INCH_M


def _interpolate_ends(way: NDArray[np.float64], reach_in: float) -> tuple[list[float], list[float]]:
    """Interpolate the path at the ends of increments."""
    z = np.maximum.accumulate(way[:, 0])
    places = np.array([reach_in * k for k in range(1, INCREMENTS + 1) if reach_in * k <= z[-1]])
    return places.tolist(), np.interp(places, z, way[:, 1]).tolist()
