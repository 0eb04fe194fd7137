"""A fault of another installed package: found by its entry point, read with its own keys, and it happens."""

from __future__ import annotations

from pathlib import Path

import pytest

from experiments.generated.missions import OFFICE, fault
from harvey.simulation.simulated_run import run_mission
from seams import install
from sim.faults.fault_registry import list_fault_kinds
from sim.scenario import Scenario, ScenarioError, parse_scenario, scenario_from_tables
from sim.stage import build_stage
from world_models.frames import Pose2

MODULE = '''
from dataclasses import dataclass
from typing import ClassVar

from sim.faults.fault import Fault, FaultTarget
from world_models.units import Bounds
from world_models.frames import Pose2


@dataclass(frozen=True)
class Earthquake(Fault):
    """The floor turns under the robot, and the lights flicker.

    Attributes:
        swing_rad: by this angle.
    """

    kind: ClassVar[str] = "earthquake"
    bounds: ClassVar = {"swing_rad": Bounds(0.0, 1.0)}

    swing_rad: float = 0.05

    def apply(self, body: FaultTarget) -> None:
        body.put_robot(body.truth.world_from_robot @ Pose2(0.0, 0.0, self.swing_rad))
        body.turn_lights_off(0.3)
        body.report_missed("earthquake: no plaster came down")


@dataclass(frozen=True)
class Landslide(Earthquake):
    """Its default is out of bounds."""

    kind: ClassVar[str] = "landslide"
    swing_rad: float = 2.0


class Unnamed(Fault):
    """It has no kind."""

    def apply(self, body: FaultTarget) -> None:
        """Nothing happens."""


class NoFault:
    """Not a fault."""
'''
ENTRY_POINTS = """[harvey.faults]
earthquake = tremors:Earthquake
landslide = tremors:Landslide
flood = tremors:NoFault
drought = tremors:Drought
tremor = tremors:Earthquake
unnamed = tremors:Unnamed
"""
QUAKE = fault("earthquake", "allens-office", 1.5, swing_deg=3.0)


@pytest.fixture(autouse=True)
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path, monkeypatch, "tremors", MODULE, ENTRY_POINTS)


def jumps_of(scenario: Scenario) -> tuple[list[float], tuple[str, ...]]:
    """Turns of more than 2 degrees from one true state to the next in which no time passes for the wheels."""
    stage = build_stage(scenario)
    turns: list[float] = []
    body = stage.body(3)
    put = body.put_robot

    def watch(pose: Pose2) -> None:
        turns.append((body.truth.world_from_robot.inverse() @ pose).heading_rad)
        put(pose)

    body.put_robot = watch  # type: ignore[method-assign]
    for _ in range(6):
        body.move(0.4)
    return turns, body.missed_faults


def test_it_is_found_by_its_entry_point_and_happens_once_in_a_mission() -> None:
    scenario = parse_scenario(OFFICE + QUAKE, "s.toml")
    turns, missed = jumps_of(scenario)
    assert turns == [pytest.approx(0.05236, abs=1e-4)] and missed == ("earthquake: no plaster came down",)
    result = run_mission(build_stage(scenario), 3)
    assert result.outcome == "reached", result.reason
    assert list(result.amiss) == ["earthquake: no plaster came down"]


def test_a_saved_run_reads_it_from_its_tables() -> None:
    scenario = parse_scenario(OFFICE + QUAKE, "s.toml")
    assert scenario_from_tables(scenario.source.data, "s", scenario.folder).faults == scenario.faults


@pytest.mark.parametrize(("text", "message"), [
    (fault("earthquake", "", 1.0, swing_deg=90.0),
     r"faults\.0\.swing_deg: expected a number from 0 to 57\.\d+, got 90"),
    (fault("earthquake", "", 1.0, duration_s=9.0), r"faults\.0\.duration_s: expected one of .*, got the key"),
    (fault("earthquak", "", 1.0), r"faults\.0\.kind: expected one of earthquake, got 'earthquak'"),
    (fault("landslide", "", 1.0), r"faults\.0: expected swing_rad from 0 to 1, got 2"),
    (fault("flood", "", 1.0), r"faults\.0\.kind: tremors 1\.0: .* flood = tremors:NoFault: expected a .*Fault, got"),
    (fault("drought", "", 1.0), r"faults\.0\.kind: tremors 1\.0: .* tremors:Drought: .* no attribute 'Drought'"),
    (fault("tremor", "", 1.0), r"faults\.0\.kind: .* tremor: .* class with kind = 'tremor', got 'earthquake'"),
    (fault("unnamed", "", 1.0), r"faults\.0\.kind: .* unnamed: expected a class with kind = 'unnamed', got None"),
])
def test_what_is_wrong_with_it_is_pointed_at(text: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=r"s\.toml:\d+: " + message):
        parse_scenario(OFFICE + text, "s.toml")


def test_the_built_in_kinds_come_first() -> None:
    kinds = list_fault_kinds()
    assert kinds[0] == "bump" and kinds[-6:] == ("drought", "earthquake", "flood", "landslide", "tremor", "unnamed")
