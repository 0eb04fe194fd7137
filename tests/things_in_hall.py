"""The north hall of a building, with a robot on a board: what stands there, and who finds it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from blackboard import Change, Effect, Entry, KnowledgeSource, Post, Revise, Scheduler
from harvey.runner.ports import WorldPort
from harvey.simulation.simulated_run import build_robot_model
from harvey.testing import Bench
from knowledge_sources.methods.belief import weigh_rivals
from knowledge_sources.model.halt_explainer import HaltExplainer
from knowledge_sources.model.model_reviser import ModelReviser
from knowledge_sources.model.rival_weigher import rival_weigher
from knowledge_sources.model.thing_mapper import ThingMapper
from knowledge_sources.model.thing_mover import ThingMover
from knowledge_sources.model.touch_finder import TouchFinder
from sim.scenario import load_scenario
from world_models.building.locale_frame import FRAME_OF, LocaleFrame
from world_models.entries import (
    Certificate,
    Contact,
    Difference,
    Evidence,
    Explanation,
    FloorThing,
    FreeFloor,
    Hypothesis,
    MilestoneVerdict,
    MotorCommand,
    Obstacle,
    diagonal,
)
from world_models.entries.entry_kinds import KINDS
from world_models.files.world_files import WORLDS, load_world
from world_models.frame_store import FrameStore
from world_models.frames import Pose2

HALL = "north-hall"
X_M, Y_M = 6.2484, 3.6576
"""The hall's corner in the world."""
HERE = Pose2(X_M + 2.0, Y_M + 1.2, 0.0)
CARTON = tuple((X_M + x, Y_M + y) for x, y in ((4.0, 1.0), (4.5, 1.0), (4.5, 1.4), (4.0, 1.4)))
FINDERS = (ThingMapper(), TouchFinder(), HaltExplainer(), ThingMover(), ModelReviser(), rival_weigher)


class Hall:
    """A board with a robot in the north hall, and round it those who find things on the floor."""

    def __init__(self, sources: Sequence[KnowledgeSource] | None = None) -> None:
        world = load_world(WORLDS / "two_ways.toml")
        store = FrameStore(world)
        sources = FINDERS if sources is None else sources
        self._scheduler = Scheduler(sources, ports=(WorldPort(store),), kinds=KINDS)
        self.board = self._scheduler.board
        self.robot = build_robot_model(load_scenario("shut-door"), world)
        self._belief = Hypothesis(HALL, Pose2(2.0, 1.2, 0.0), diagonal(0.01, 0.005), "tracks")
        frames = [Post(store.frame(name)) for name in ("", HALL, "reception", "archive")]
        self.apply(*map(Post, self.robot.entries()), *frames, Post(self._belief))

    def put(self, value: object, *because: Entry[object]) -> Entry[object]:
        """Something new, and all that follows; the entry as it was posted."""
        (change,) = self.apply(Post(value, because))
        return change.entry

    @property
    def bench(self) -> Bench:
        """Its board, for laws that take one."""
        bench = Bench()
        bench.board = self.board
        return bench

    def belief(self) -> Entry[Hypothesis]:
        belief = self.board.view.latest(Hypothesis)
        assert belief is not None
        return belief

    def look(self, *things: FloorThing, seen_s: float, far_m: float = 4.0, ahead_m: float = 0.0) -> FreeFloor:
        """What one sight of the floor shows: free up to ``far_m``, with some things on it."""
        bearings = np.linspace(-0.5, 0.5, 41)
        far = np.full(41, far_m)
        for thing in things:
            corners = np.array(thing.footprint) - HERE.position
            angles = np.arctan2(corners[:, 1], corners[:, 0])
            hit = (bearings >= angles.min() - 0.02) & (bearings <= angles.max() + 0.02)
            far[hit] = np.minimum(far[hit], np.linalg.norm(corners, axis=1).min())
        return FreeFloor("camera", HALL, HERE.x_m + ahead_m, HERE.y_m, tuple(bearings.tolist()), (1.5,) * 41,
                         tuple(far.tolist()), ("sight",) * 41, (0.02,) * 41, things, seen_s, confirmed_m=(far_m,) * 41)

    def see(self, *things: FloorThing, seen_s: float, far_m: float = 4.0, ahead_m: float = 0.0) -> None:
        """One sight of the floor: free up to ``far_m``, with some things on it."""
        self.apply(Post(self.look(*things, seen_s=seen_s, far_m=far_m, ahead_m=ahead_m)))

    def touch(self, direction_rad: float, *, turns: tuple[float, ...], basis: str) -> None:
        """Something is touched ahead in the hall; then the robot turns, and its place is found to be as believed."""
        (asked,) = self.apply(Post(MotorCommand(0.0, 0.5)))
        self.apply(Post(Contact("bumper", direction_rad, 0.15, 3.0), (asked.entry,)))
        for turn_rad in turns:
            self.apply(Post(MotorCommand(turn_rad, 0.0)))
        belief = self.belief()
        pose = Pose2(2.0, 1.2, sum(turns))
        known = Hypothesis(HALL, pose, diagonal(0.01, 0.005), basis)
        self.apply(Revise(belief, known, (belief,)))

    def verify(self, verdict: MilestoneVerdict = "verified") -> None:
        """A milestone is judged."""
        self.apply(Post(Certificate("Milestone-1", "", verdict, "so it was", 9, 9, 9, 1.0, 0.2, 0.0, 0.0, 0.0, 4.0,
                                     1e-3, 1e-3, 0.006)))

    def find(self, basis: str, correction: Pose2 | None = None) -> None:
        """The belief is corrected by a milestone, or by being found after it was lost, so far from where it was."""
        belief = self.belief()
        pose = belief.value.locale_from_robot @ (correction or Pose2(0.0, 0.0, 0.0))
        found = replace(belief.value, basis=basis, locale_from_robot=pose, correction=correction)
        self.apply(Revise(belief, found, (belief,)))

    def apply(self, *effects: Effect) -> tuple[Change, ...]:
        """Something happens, and is answered until nothing is left to do."""
        changes = self._scheduler.post(effects, "test")
        while (decision := self._scheduler.step()) is not None:
            assert not decision.refused, decision.refused
        return changes

    @property
    def obstacles(self) -> list[Obstacle]:
        return [entry.value for entry in self.board.view.all(Obstacle)]

    @property
    def frame(self) -> LocaleFrame:
        entry = self.board.view.newest(FRAME_OF, HALL)
        assert entry is not None
        return entry.value


def known_by_sight(thing: Obstacle, eye: tuple[float, float] = (-9.0, 0.0)) -> Difference:
    """The difference that makes a thing as certain as it is, by one sight."""
    ratio = math.log(thing.certainty / (1.0 - thing.certainty))
    seen = Evidence(thing.name, "seen", (Explanation("thing", "a thing", ratio),), *eye, 0.0, 0.1, math.tau, 0.0)
    return weigh_rivals(thing.name, (seen,))


def carton(p_thing: float = 0.97, *, by_m: float = 0.0, height_m: float = 0.4) -> FloorThing:
    corners = tuple((x, y + by_m) for x, y in CARTON)
    left = 200.0 - 100.0 * by_m
    return FloorThing(corners, 0.03, height_m, 0.05, p_thing, (left, 300.0, left + 60.0, 350.0), "unlike the floor")
