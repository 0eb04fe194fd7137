"""One world, one process: runs missions in it when told to on standard input, and answers with a line of JSON.

``start``: a new mind from the command to its first motor command, the file opened anew. ``plan``: the whole mission in
thought. ``drive``: the whole mission in the simulator. ``memory``: what the process held at most. Times are of the
processor.
"""

from __future__ import annotations

import hashlib
import json
import sys
import time
from pathlib import Path
from typing import Any

from blackboard.effect import Post
from blackboard.journal import Decision, JournalLines
from blackboard.scheduler import Scheduler
from harvey.experiments.planning import planned
from harvey.loop import until_outcome
from harvey.ports import BodyPort
from harvey.wiring import command, knowledge_sources, robot_model, servoing
from sim.ailments import AilingBody
from sim.assembly import Stage, set_stage
from sim.scenario import parse_scenario
from world_models.body import MotorCommand
from world_models.sqlite_frames import SqliteFrames
from world_models.world import World

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
    """Notes the time of each decision, and the journal's text."""

    def __init__(self) -> None:
        self.first_s: float | None = None
        self.decisions = 0
        self._line, self._digest = JournalLines(), hashlib.sha256()
        self.begin()

    def begin(self) -> None:
        """The clock runs from now."""
        self._began = time.process_time()

    def __call__(self, decision: Decision) -> None:
        now = time.process_time()
        if self.first_s is None and any(isinstance(c.entry.value, MotorCommand) for c in decision.made):
            self.first_s = now - self._began
        self.decisions += 1
        self._digest.update(self._line(decision).encode())

    @property
    def journal(self) -> str:
        return self._digest.hexdigest()


def main(path: str, goal: str, seed: str) -> None:
    """Answer until standard input ends."""
    stage = set_stage(parse_scenario(SCENARIO.format(world=Path(path).as_posix(), goal=goal), "world-size"))
    for line in sys.stdin:
        match line.strip():
            case "start":
                answer = _start(stage, int(seed))
            case "plan":
                answer = {"steps_ms": planned(robot_model(stage.scenario), stage.scenario).steps_ms}
            case "drive":
                answer = _drive(stage, int(seed))
            case _:
                answer = {"mb": most_mb()}
        print(json.dumps(answer), flush=True)


def most_mb() -> float:
    """The most memory that this process has held since it was started [MB] (Linux)."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.split("VmHWM:")[1].split()[0]) / 1024.0


def _mind(stage: Stage, seed: int, watcher: _Watcher) -> tuple[Scheduler, World]:
    robot = robot_model(stage.scenario)
    port = BodyPort(AilingBody(stage.body(seed)))
    scheduler = Scheduler(
        knowledge_sources(robot), ports=(port,), servoing=servoing(stage.scenario.servo), sinks=(watcher,))
    return scheduler, robot.world


def _start(stage: Stage, seed: int) -> dict[str, Any]:
    began = time.process_time()
    robot_model(stage.scenario)
    open_ms = 1000.0 * (time.process_time() - began)
    watcher = _Watcher()
    scheduler, world = _mind(stage, seed, watcher)
    watcher.begin()
    scheduler.tell([Post(command(stage.scenario))], "user")
    while watcher.first_s is None and scheduler.step() is not None:
        pass
    return {"open_ms": open_ms, "first_ms": 1000.0 * (watcher.first_s or float("inf")), "far_ms": _far_ms(world)}


def _far_ms(world: World) -> float:
    """How long it takes to sketch the way to the last locale, and its first and last stretch."""
    frames = world.frames
    assert isinstance(frames, SqliteFrames)
    last = frames.last_room()
    began = time.process_time()
    route = world.route("robot-laboratory", last)
    if route is not None and route.steps:
        world.route("robot-laboratory", route.steps[0].origin)
        world.route(route.steps[-1].destination, last)
    return 1000.0 * (time.process_time() - began)


def _drive(stage: Stage, seed: int) -> dict[str, Any]:
    watcher = _Watcher()
    scheduler, world = _mind(stage, seed, watcher)
    scheduler.tell([Post(command(stage.scenario))], "user")
    outcome = until_outcome(scheduler)
    frames = world.frames
    assert isinstance(frames, SqliteFrames)
    return {"outcome": outcome.kind, "journal": watcher.journal, "decisions": watcher.decisions,
            "touched": len(frames.touched), "frames": frames.touched}


if __name__ == "__main__":
    main(*sys.argv[1:])
