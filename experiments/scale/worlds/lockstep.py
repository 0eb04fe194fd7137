"""The same mission in several worlds at once, decision by decision in turn, so that a busy machine delays all equally.

One process opens all worlds for each repetition and lets their agents decide in turn, each in turn first; as all decide
the same, the n-th decisions can be compared. Each repetition is printed as a line of JSON. Times are of the processor;
garbage is collected only between repetitions, as its time would be charged to an arbitrary world.
"""

from __future__ import annotations

import gc
import json
import sys
import time
from collections.abc import Callable, Sequence

from blackboard.effect import Post
from experiments.paper.planning import DryMission
from experiments.scale.worlds.probe import build_probe_stage
from harvey.runner.ports import BodyPort
from harvey.runner.world_port import build_scheduler
from harvey.simulation.run import build_robot_model
from harvey.wiring import knowledge_sources, servoing
from knowledge_sources.settings import DEFAULT
from sim.body.faulty_body import FaultyBody
from sim.stage import Stage
from world_models.entries.body import MotorCommand
from world_models.entries.kinds import KINDS
from world_models.files.world_files import load_world

Step = Callable[[], bool]
"""Makes one decision; False when done."""


def main(goal: str, seed: str, starts: str, plans: str, *paths: str) -> None:
    """Print the times of all starts (to the first motor command) and of whole dry runs."""
    stages = [build_probe_stage(path, goal) for path in paths]
    for turn in range(int(starts)):
        agents = [_start(stage, int(seed)) for stage in stages]
        print(json.dumps({"start": decide_in_turn(agents, turn)}), flush=True)
    for turn in range(int(plans)):
        missions = [DryMission(load_world(stage.scenario.world), stage.scenario) for stage in stages]
        decide_in_turn([mission.step for mission in missions], turn)
        print(json.dumps({"plan": [mission.clock.steps_ms for mission in missions]}), flush=True)


def _start(stage: Stage, seed: int) -> Step:
    """Build a new agent with its body; it is done at its first motor command."""
    world = load_world(stage.scenario.world)
    scheduler = build_scheduler(
        knowledge_sources(DEFAULT), world, build_robot_model(stage.scenario, world),
        ports=(BodyPort(FaultyBody(stage.body(seed))),), servoing=servoing(stage.scenario.servo), kinds=KINDS)
    scheduler.tell([Post(stage.scenario.command)], "user")

    def step() -> bool:
        decision = scheduler.step()
        return decision is not None and not any(isinstance(c.entry.value, MotorCommand) for c in decision.made)

    return step


def decide_in_turn(agents: Sequence[Step], turn: int) -> list[list[float]]:
    """Let all decide until all are done; returned are the times of the decisions of each [ms]."""
    times: list[list[float]] = [[] for _ in agents]
    left = list(range(len(agents)))
    gc.collect()
    gc.disable()
    try:
        while left:
            turn += 1
            for agent in sorted(left, key=lambda agent: (agent + turn) % len(agents)):
                began = time.process_time_ns()
                if not agents[agent]():
                    left.remove(agent)
                times[agent].append((time.process_time_ns() - began) / 1e6)
    finally:
        gc.enable()
    return times


if __name__ == "__main__":
    main(*sys.argv[1:])
