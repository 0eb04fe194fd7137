"""A fifth of the view is hidden for good: the robot finds out what hides it, and arrives without being lost."""

from __future__ import annotations

import numpy as np

from blackboard import Decision
from experiments.generated.missions import HALLWAY, fault
from harvey.simulation.simulated_run import run_mission
from logs.timeline import Timeline
from recorded_runs import Recorded
from sim.faults.built_in_faults import Occlusion
from sim.scenario import parse_scenario
from sim.stage import build_stage
from world_models.entries import Milestone, Obstruction

HIDDEN = fault("occluded", "hallway", 3.0, part=0.2, duration_s=1000.0)


def test_it_finds_what_is_before_its_camera_and_looks_past_it() -> None:
    known: list[Obstruction] = []
    behind: list[np.ndarray] = []
    found_by: list[str] = []

    def watch(decision: Decision) -> None:
        for change in decision.made:
            value = change.entry.value
            if isinstance(value, Obstruction):
                known.append(value)
                found_by.append(change.entry.author)
            if isinstance(value, Milestone) and value.expected_px and known:
                behind.append(known[-1].hidden_part(value.expected_px))

    stage = build_stage(parse_scenario(HALLWAY + HIDDEN, "behind-something"))
    result = run_mission(stage, 0, sinks=[watch])
    assert result.outcome == "reached" and result.final_error_m < 0.0254
    assert result.collisions == 0 and result.milestones["false_accepts"] == 0
    assert found_by[0] == "obstruction_finder" and result.relocalizations == 0

    grid = np.stack(np.meshgrid(np.arange(512.0), np.arange(512.0)), axis=-1)
    said = known[-1].covers(grid)
    true = stage.scenario.faults[0]
    assert isinstance(true, Occlusion) and abs(np.mean(said) - true.part) < 0.02
    assert behind and all(np.all(part <= 0.3) for part in behind)


def test_where_nothing_is_hidden_nobody_asks_what_is(recorded: Recorded) -> None:
    chosen = {record.chosen.source for record in Timeline(recorded("office").journal).decisions() if record.chosen}
    assert "milestone_judge" in chosen and "obstruction_finder" not in chosen
