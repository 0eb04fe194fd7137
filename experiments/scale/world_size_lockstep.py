"""The same mission in several worlds at once, decision by decision in turn, so that a busy machine delays all alike.

One process opens all worlds anew for each repetition and lets their agents decide in turn, each in turn first; as all
decide the same, the n-th decisions can be compared. Every repetition is told as a line of JSON. Times are of the
processor; garbage is collected between repetitions only, as in one process it would fall on whichever world is at hand.
"""

from __future__ import annotations

import gc
import json
import sys
import time
from collections.abc import Callable, Sequence

from blackboard.effect import Post
from blackboard.scheduler import Scheduler
from experiments.paper.planning import Thought
from experiments.scale.world_size_probe import staged
from harvey.runner.ports import BodyPort
from harvey.simulation.run import robot_model
from harvey.wiring import knowledge_sources, servoing
from sim.body.faulty_body import FaultyBody
from sim.stage import Stage
from world_models.entries.body import MotorCommand

Step = Callable[[], bool]
"""Decides once more; False when it is done."""


def main(goal: str, seed: str, starts: str, plans: str, *paths: str) -> None:
    """Tell all repetitions of starts (to the first motor command) and of whole missions in thought."""
    stages = [staged(path, goal) for path in paths]
    for turn in range(int(starts)):
        agents = [_start(stage, int(seed)) for stage in stages]
        print(json.dumps({"start": _in_turn(agents, turn)}), flush=True)
    for turn in range(int(plans)):
        thoughts = [Thought(robot_model(stage.scenario), stage.scenario) for stage in stages]
        _in_turn([thought.step for thought in thoughts], turn)
        print(json.dumps({"plan": [thought.clock.steps_ms for thought in thoughts]}), flush=True)


def _start(stage: Stage, seed: int) -> Step:
    """A new agent with its body, from the command on; it is done with its first motor command."""
    robot = robot_model(stage.scenario)
    scheduler = Scheduler(knowledge_sources(robot), ports=(BodyPort(FaultyBody(stage.body(seed))),),
                          servoing=servoing(stage.scenario.servo))
    scheduler.tell([Post(stage.scenario.command)], "user")

    def step() -> bool:
        decision = scheduler.step()
        return decision is not None and not any(isinstance(c.entry.value, MotorCommand) for c in decision.made)

    return step


def _in_turn(agents: Sequence[Step], turn: int) -> list[list[float]]:
    """Let all decide until all are done; for each the time of each of its decisions [ms]."""
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
