"""A mission with a camera that is mounted otherwise than believed: it is reached, and the camera is known better."""

from __future__ import annotations

import math

import numpy as np
import pytest

from blackboard.journal import Decision
from harvey.simulation.run import run_mission
from sim.scenario import load_scenario, with_settings
from sim.stage import build_stage
from world_models.camera import CAMERA_UNKNOWNS, subtract_cameras
from world_models.entries.robot import CameraState

WRONG = {"truth.camera.tilt_deg": "-2", "truth.camera.roll_deg": "1.5", "truth.camera.height_m": "0.06",
         "truth.camera.focal_px": "9"}


@pytest.mark.parametrize("settings", [{}, WRONG], ids=["as believed", "otherwise"])
def test_the_camera_is_learnt_on_the_way(settings: dict[str, str]) -> None:
    scenario = with_settings(load_scenario("forty-foot-hallway"), settings)
    states: list[CameraState] = []

    def listen(decision: Decision) -> None:
        for change in (*decision.observed, *decision.made):
            if isinstance(change.entry.value, CameraState):
                states.append(change.entry.value)

    result = run_mission(build_stage(scenario), 2, sinks=[listen])
    assert result.outcome == "reached" and result.milestones["false_accepts"] == 0
    assert result.final_error_m is not None and result.final_error_m < 0.0254
    truth = scenario.truth.camera.mounted(scenario.camera.camera, scenario.camera.mount)
    seen = [i for i, name in enumerate(CAMERA_UNKNOWNS) if name != "yaw_rad"]
    for state in states[1:]:
        off = np.array(subtract_cameras(state.lens, state.mount, *truth))[seen]
        assert np.all(np.abs(off) < 4.0 * np.sqrt(np.diag(np.array(state.covariance)))[seen])
    tilt, roll, _, height, *_ = subtract_cameras(states[-1].lens, states[-1].mount, *truth)
    assert max(abs(tilt), abs(roll)) < math.radians(0.05) and abs(height) < 0.005
