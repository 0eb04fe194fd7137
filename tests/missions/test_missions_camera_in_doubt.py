"""A lost robot whose camera was taught by pictures of a place that is in doubt: it tries the camera as told too."""

from __future__ import annotations

from dataclasses import replace

import pytest

from blackboard import Revise
from experiments.robustness.kidnap import Kidnap, _build_lost_agent, _draw_poses, _is_found, _scene, get_floor
from harvey.runner.run import run_to_outcome
from knowledge_sources.relocalizer.localizer import MAX_DOUBTED_PICTURES
from sim.body.faulty_body import FaultyBody
from sim.body.simulated_body import SimulatedBody
from world_models.camera import CAMERA_UNKNOWNS
from world_models.entries import CameraState, Hypothesis
from world_models.frames import Pose2

MOST = MAX_DOUBTED_PICTURES
WRONGLY = tuple({"focal": 0.025, "tilt_rad": 0.01}.get(name, 0.0) for name in CAMERA_UNKNOWNS)


@pytest.mark.parametrize(("pictures", "is_told_again"), [(1, True), (MOST, True), (MOST + 1, False)])
def test_a_camera_that_few_pictures_taught_wrongly_is_as_told_again(pictures: int, is_told_again: bool) -> None:
    trial = Kidnap(200, 8, False, 0)
    scene = _scene(get_floor(trial))
    _, there, belief = _draw_poses(trial, scene.floor)
    body = SimulatedBody(scene.building, there, scene.robot.camera, scene.robot.mount, seed=trial.number)
    scheduler = _build_lost_agent(scene, FaultyBody(body), belief)
    told = scheduler.view.latest(CameraState)
    assert told is not None and told.value.nominal_lens is None
    taught = replace(told.value.moved(WRONGLY), counted=tuple((0.1 * k, 0.0, 0.0) for k in range(pictures)))
    assert taught.lens != told.value.lens and taught.as_nominal() == told.value
    scheduler.post([Revise(told, taught)], "user")
    run_to_outcome(scheduler, over=lambda s: "found" if _is_found(s) else None)
    camera, held = scheduler.view.latest(CameraState), scheduler.view.latest(Hypothesis, lambda h: h.is_held)
    assert camera is not None and held is not None
    assert (camera.value == told.value) == is_told_again
    if is_told_again:
        found: Pose2 = held.value.world_from_robot(scene.robot.world)
        assert held.value.basis == "relocalization" and found.distance_to(body.truth.world_from_robot) < 0.02
