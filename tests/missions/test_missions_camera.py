"""A mission with a camera that is mounted differently than believed: it is reached, and the camera is known better."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from blackboard import Decision
from harvey.simulation.simulated_run import run_mission
from sim.faults.built_in_faults import CameraKnocked
from sim.scenario import load_scenario, with_settings
from sim.stage import build_stage
from world_models.camera import CAMERA_UNKNOWNS, YAW, subtract_cameras
from world_models.entries import CameraState

WRONG = {"truth.camera.tilt_deg": "-2", "truth.camera.roll_deg": "1.5", "truth.camera.height_m": "0.06",
         "truth.camera.focal_px": "9"}


@pytest.mark.parametrize("settings", [{}, WRONG], ids=["as believed", "otherwise"])
def test_the_camera_is_learnt_on_the_way(settings: dict[str, str], tmp_path: Path) -> None:
    scenario = with_settings(load_scenario("forty-foot-hallway"), settings)
    states: list[CameraState] = []

    def listen(decision: Decision) -> None:
        for change in (*decision.observed, *decision.made):
            if isinstance(change.entry.value, CameraState):
                states.append(change.entry.value)

    result = run_mission(build_stage(scenario), 2, out=tmp_path / "run", sinks=[listen])
    assert (tmp_path / "run" / "camera.toml").exists() == bool(settings)
    assert result.outcome == "reached" and result.milestones["false_accepts"] == 0
    assert result.final_error_m is not None and result.final_error_m < 0.0254
    truth = scenario.truth.camera.mounted(scenario.camera.camera, scenario.camera.mount)
    seen = [i for i, name in enumerate(CAMERA_UNKNOWNS) if name != "yaw_rad"]
    for state in states[1:]:
        off = np.array(subtract_cameras(state.lens, state.mount, *truth))[seen]
        assert np.all(np.abs(off) < 4.0 * np.sqrt(np.diag(np.array(state.covariance)))[seen])
    tilt, roll, _, height, *_ = subtract_cameras(states[-1].lens, states[-1].mount, *truth)
    assert max(abs(tilt), abs(roll)) < math.radians(0.05) and abs(height) < 0.005


def test_a_knock_in_mid_mission_is_noticed_and_survived() -> None:
    """The robot is not taken for kidnapped: the camera is believed differently, and the mission is reached."""
    knock = CameraKnocked(after_m=4.0, tilt_rad=math.radians(2.0), roll_rad=math.radians(-1.0),
                          yaw_rad=math.radians(-2.0))
    scenario = replace(load_scenario("forty-foot-hallway"), faults=(knock,))
    states: list[CameraState] = []

    def listen(decision: Decision) -> None:
        states.extend(c.entry.value for c in decision.made if isinstance(c.entry.value, CameraState))

    result = run_mission(build_stage(scenario), 1, sinks=[listen])
    assert result.outcome == "reached" and result.relocalizations == 0 and result.milestones["false_accepts"] == 0
    before, after = scenario.camera.mount, states[-1].mount
    assert after.tilt_rad - before.tilt_rad == pytest.approx(knock.tilt_rad, abs=math.radians(0.05))
    assert after.roll_rad - before.roll_rad == pytest.approx(knock.roll_rad, abs=math.radians(0.05))
    sigma_rad = math.sqrt(states[-1].covariance[YAW][YAW])
    # The way that tells the yaw is measured by beliefs that count each picture once, so it is told less surely.
    assert abs(after.yaw_rad - before.yaw_rad - knock.yaw_rad) < min(3.0 * sigma_rad, math.radians(1.5))
    assert sigma_rad < math.radians(1.5)
