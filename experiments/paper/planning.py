"""How long Harvey plans: the sketches of Figure 17 with all their milestones (§7: about 5 minutes, 21 milestones).

The mission is driven in thought, as ``harvey run --check`` does: every milestone is verified at once, and the wheels do
exactly what they are asked. What is timed are the decisions of interpreter, sketcher and milestone selector.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace

import numpy as np
from tqdm import tqdm

from blackboard.change import Quiescence
from blackboard.effect import Post
from blackboard.journal import Decision
from blackboard.scheduler import Scheduler
from experiments.report import Report
from harvey.dry_run import AcceptEveryMilestone, IdealBodyPort
from harvey.simulation.run import robot_model
from harvey.wiring import knowledge_sources
from sim.scenario import Scenario, load_scenario
from world_models.building.world import World
from world_models.entries.task import Milestone, Outcome, PlanSketch
from world_models.robot import RobotModel

PAPER_MS = 5 * 60 * 1000.0
BOUND_MS = 100.0
REPETITIONS, QUICK_REPETITIONS = 40, 10
PLANNERS = ("interpreter", "sketcher", "milestone_selector")
TAKING_PART = (*PLANNERS, "motor", "dead_reckoner", "elevator_rider", "mission_monitor")


class Clock:
    """Adds up the time of the planners' decisions, and counts what they wrote."""

    def __init__(self) -> None:
        self.ms = dict.fromkeys(PLANNERS, 0.0)
        self.steps_ms: list[float] = []
        self.sketches = self.milestones = 0
        self.begin()

    def begin(self) -> None:
        """The next decision begins now."""
        self._began = time.thread_time()

    def __call__(self, decision: Decision) -> None:
        now = time.thread_time()
        if decision.chosen is not None and decision.chosen.source.name in self.ms:
            self.steps_ms.append(1000.0 * (now - self._began))
            self.ms[decision.chosen.source.name] += self.steps_ms[-1]
        values = [change.entry.value for change in decision.made if change.entry.revision == 0]
        self.sketches += sum(1 for value in values if isinstance(value, PlanSketch))
        self.milestones += sum(1 for value in values if isinstance(value, Milestone))


def run(quick: bool, seed: int) -> Report:
    """The mission is planned many times, each with a new agent and a world that nobody has looked at."""
    scenario = load_scenario("lab-to-allens-office")
    robot = robot_model(scenario)
    _planned(robot, scenario)
    turns = range(QUICK_REPETITIONS if quick else REPETITIONS)
    shown = tqdm(turns, file=sys.stderr, disable=not sys.stderr.isatty(), leave=False)
    clocks = [_planned(robot, scenario) for _ in shown]
    totals = [sum_of(clock) for clock in clocks]
    best = clocks[int(np.argmin(totals))]
    rows = [("sketches", 3, best.sketches), ("milestones", 21, best.milestones),
            ("all of the planning, least [ms]", PAPER_MS, sum_of(best)),
            ("all of the planning, median [ms]", None, float(np.median(totals)))]
    rows += [(f"of it: {name} [ms]", None, best.ms[name]) for name in PLANNERS]
    return Report(
        "Planning Figure 17's mission", ("what", "paper", "ours"), tuple(rows),
        notes=(
            f"{len(clocks)} times from the command to the goal; the mission is driven in thought, so that every sketch"
            " is drawn and every milestone chosen as on the way.",
            "Each time with a new agent, routes and views unknown. Not counted: reading the file, and laying out each"
            " room's surfaces in arrays, once for each room and world. Times are of the processor, so that what else"
            " the machine does counts less.",
            "sketches: the route, then one for each of the three rooms; the paper's set has the rooms' only.",
            "paper: a VAX 11-750, planner in Common Lisp. Peer: none plans milestones.",
        ),
        claims=((f"all sketches and milestones in less than {BOUND_MS:.0f} ms ({sum_of(best):.1f})",
                 sum_of(best) < BOUND_MS),),
    )


def sum_of(clock: Clock) -> float:
    """All of the planners' time [ms]."""
    return float(np.sum(list(clock.ms.values())))


def _planned(known: RobotModel, scenario: Scenario) -> Clock:
    world = World(known.world.locale_source)
    world.cache["looks"] = known.world.cache.setdefault("looks", {})  # surfaces in arrays, laid out once
    return planned(replace(known, world=world), scenario)


def planned(robot: RobotModel, scenario: Scenario) -> Clock:
    """Plan and drive a scenario's mission in thought."""
    thought = Thought(robot, scenario)
    while thought.step():
        pass
    return thought.clock


class Thought:
    """A scenario's mission in thought, decision by decision.

    Attributes:
        clock: what was planned so far, and how long it took.
    """

    def __init__(self, robot: RobotModel, scenario: Scenario) -> None:
        experts = [source for source in knowledge_sources(robot) if source.name in TAKING_PART]
        self.clock = Clock()
        self._scheduler = Scheduler([*experts, AcceptEveryMilestone()], ports=(IdealBodyPort(),), sinks=(self.clock,))
        self._scheduler.tell([Post(scenario.command)], "user")

    def step(self) -> bool:
        """Decide once more; False when there is an outcome."""
        self.clock.begin()
        if self._scheduler.step() is None:
            self._scheduler.tell([Post(Quiescence(self._scheduler.cycle))], "scheduler")
        return self._scheduler.view.latest(Outcome) is None
