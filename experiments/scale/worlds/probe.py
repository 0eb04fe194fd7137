"""One world in one process: runs missions on request on standard input, and answers with a line of JSON.

``open``: open the file and find a far route in it. ``drive``: the whole mission in the simulator. ``memory``: peak
memory of the process. Times are of the processor.
"""

from __future__ import annotations

import hashlib
import json
import sys
import time
from pathlib import Path
from typing import Any

from blackboard.effect import Post
from blackboard.journal import Decision, decision_line
from harvey.runner.ports import BodyPort
from harvey.runner.run import run_to_outcome
from harvey.runner.world_port import build_scheduler
from harvey.simulation.run import build_robot_model
from harvey.wiring import knowledge_sources, servoing
from knowledge_sources.settings import DEFAULT
from sim.body.faulty_body import FaultyBody
from sim.scenario import parse_scenario
from sim.stage import Stage, build_stage
from world_models.building.world import World
from world_models.entries.kinds import KINDS
from world_models.files.packed import PackedFrames
from world_models.files.world_files import load_world

SCENARIO = """
world = "{world}"
details = ["research_center_details"]
goal = "{goal}"

[start]
heading_deg = 90.0
put_down_sigma_m = 0.02
put_down_sigma_deg = 1.0
"""


class _Watcher:
    """Counts the decisions, and computes a digest of the journal's text."""

    def __init__(self) -> None:
        self.decisions = 0
        self._digest = hashlib.sha256()

    def __call__(self, decision: Decision) -> None:
        self.decisions += 1
        self._digest.update(decision_line(decision).encode())

    @property
    def journal(self) -> str:
        return self._digest.hexdigest()


def main(path: str, goal: str, seed: str) -> None:
    """Answer until standard input ends."""
    stage = build_probe_stage(path, goal)
    for line in sys.stdin:
        match line.strip():
            case "open":
                answer = _open(stage)
            case "drive":
                answer = _drive(stage, int(seed))
            case _:
                answer = {"mb": peak_mb()}
        print(json.dumps(answer), flush=True)


def build_probe_stage(path: str, goal: str) -> Stage:
    """Build the mission's stage in the world of a file."""
    return build_stage(parse_scenario(SCENARIO.format(world=Path(path).as_posix(), goal=goal), "world-size"))


def peak_mb() -> float:
    """Peak memory of this process [MB] (Linux)."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.split("VmHWM:")[1].split()[0]) / 1024.0


def _open(stage: Stage) -> dict[str, Any]:
    began = time.process_time()
    world = load_world(stage.scenario.world)
    open_ms = 1000.0 * (time.process_time() - began)
    return {"open_ms": open_ms, "far_ms": _time_far_route_ms(world)}


def _time_far_route_ms(world: World) -> float:
    """Time to find the route to the last locale and refine its first and last step."""
    last = list(world.frames)[-1]
    began = time.process_time()
    route = world.route("robot-laboratory", last)
    if route is not None and route.steps:
        world.route("robot-laboratory", route.steps[0].origin)
        world.route(route.steps[-1].destination, last)
    return 1000.0 * (time.process_time() - began)


def _drive(stage: Stage, seed: int) -> dict[str, Any]:
    watcher, world = _Watcher(), load_world(stage.scenario.world)
    scheduler = build_scheduler(
        knowledge_sources(DEFAULT), world, build_robot_model(stage.scenario, world),
        ports=(BodyPort(FaultyBody(stage.body(seed))),), servoing=servoing(stage.scenario.servo), sinks=(watcher,),
        kinds=KINDS)
    scheduler.tell([Post(stage.scenario.command)], "user")
    outcome = run_to_outcome(scheduler)
    frames = world.frames
    assert isinstance(frames, PackedFrames)
    return {"outcome": outcome.kind, "journal": watcher.journal, "decisions": watcher.decisions,
            "touched": len(frames.touched), "frames": frames.touched}


if __name__ == "__main__":
    main(*sys.argv[1:])
