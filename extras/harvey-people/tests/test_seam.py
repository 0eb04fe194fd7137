"""The seam of the simulator: what a package reads from ``[[walkers]]`` enters the building, and moves with time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import pytest

from sim import scenario as scenario_file
from sim.body.simulated_building import SimulatedBuilding
from sim.scenario import ScenarioError, parse_scenario
from sim.stage import build_stage
from world_models.building.world import World
from world_models.files.toml.source import Node
from world_models.frames import Pose2


def test_who_walks_there_is_told_where_the_robot_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a package reads from ``[[walkers]]`` enters the building; without the package it is said what to install."""
    text = 'world = "research_center"\ngoal = "(ptrans (hallway (4,4,0)) (hallway (9,4,0)))"\n[[walkers]]\n'
    with monkeypatch.context() as absent, pytest.raises(ScenarioError, match=r"it needs harvey\.movers of a package"):
        absent.setattr(scenario_file, "list_absent", lambda group: {"walkers": f"{group} of a package"})
        parse_scenario(text)
    told: list[tuple[float, Pose2]] = []

    class Nobody:
        def read(self, _node: Node) -> Nobody:
            return self

        def enter(self, building: SimulatedBuilding, _world: World, seed: int) -> SimulatedBuilding:
            def follow(time_s: float, robot: Pose2) -> SimulatedBuilding:
                told.append((time_s, robot))
                return replace(building, news=(f"seed {seed}",))
            return replace(building, at_time=follow)

        @property
        def guests(self) -> Mapping[str, str]:
            return {}

        def charge(self, _who: str) -> float:
            return 0.0

    monkeypatch.setattr(scenario_file, "list_absent", lambda _group: {})
    monkeypatch.setattr(scenario_file, "load_plugins", lambda *_: {"walkers": Nobody()})
    body = build_stage(parse_scenario(text)).body(7)
    body.wait(2.0)
    assert told == [(2.0, body.truth.world_from_robot)] and body.happened == ("seed 7",)
