"""Laws of what is told about the camera at the end, and of the file that keeps it for the next mission."""

from __future__ import annotations

import math
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from harvey.runner.run import build_camera_text
from knowledge_sources.methods.calibration import (
    LEAST_SIGMA_CENTRE_PX,
    LEAST_SIGMA_FOCAL,
    LEAST_SIGMA_M,
    LEAST_SIGMA_RAD,
    compute_camera_covariance,
    has_counted,
    learn,
)
from world_models.camera import CAMERA_UNKNOWNS, Camera, CameraMount
from world_models.entries import CameraState, find_camera_lessons
from world_models.files.toml.camera_file import load_camera
from world_models.frames import Pose2

TOLD = CameraState(Camera(400.0, 400.0, 255.5, 255.5, 512, 512), CameraMount(1.0, 0.1))
SIGMAS = np.array([1e-4, 1e-4, 1e-3, 1e-3, 1e-3, 0.3, 0.3])
HERE = Pose2(1.0, 2.0, 0.3)
steps = st.tuples(*(st.floats(-20.0 * sigma, 20.0 * sigma) for sigma in SIGMAS))


def learnt(step: tuple[float, ...]) -> CameraState:
    return learn(TOLD, step, np.diag(SIGMAS**2), HERE)


@given(steps)
def test_what_is_told_is_surely_so_and_in_the_right_direction(step: tuple[float, ...]) -> None:
    told = find_camera_lessons(TOLD, learnt(step))
    by_name = dict(zip(CAMERA_UNKNOWNS, step, strict=True))
    for lesson in told:
        assert abs(lesson.off) > 3.0 * lesson.sigma
        assert lesson.off == pytest.approx(by_name[lesson.what], abs=1e-9) and lesson.text().startswith("camera ")
    assert find_camera_lessons(TOLD, TOLD) == () and find_camera_lessons(TOLD, learnt((0.0,) * 7)) == ()


def test_a_camera_that_looks_lower_is_told_so() -> None:
    state = learnt((math.radians(1.1), 0.0, 0.0, -0.03, 0.0, 0.0, 0.0))
    texts = [lesson.text() for lesson in find_camera_lessons(TOLD, state)]
    assert texts == [
        "camera looks 1.10 degrees lower than told (+-0.02)", "camera is 30.00 mm lower than told (+-1.50)"]


@given(steps)
def test_the_next_mission_begins_with_what_was_learnt(step: tuple[float, ...]) -> None:
    state = learnt(step)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "camera.toml"
        file.write_text(build_camera_text(state, "a mission"), encoding="utf-8")
        read = load_camera(file)
    assert read.mount is not None and read.camera.fx == pytest.approx(state.lens.fx)
    for name in ("height_m", "forward_m", "tilt_rad", "roll_rad", "yaw_rad"):
        assert getattr(read.mount, name) == pytest.approx(getattr(state.mount, name), abs=1e-12)
    d = read.deviation
    again = CameraState(read.camera, read.mount, d.tilt_rad, d.height_m, d.forward_m, d.focal, d.roll_rad, d.yaw_rad)
    known = np.diag(compute_camera_covariance(again))[:5]
    assert np.allclose(known, np.diag(np.array(state.covariance))[:5], rtol=1e-6)


@given(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(-0.17, 0.17))
def test_a_picture_from_the_same_place_does_not_count_again(x: float, y: float, turn: float) -> None:
    state = learnt((0.0,) * 7)
    assert has_counted(state, Pose2(HERE.x_m + x, HERE.y_m + y, HERE.heading_rad + turn))
    assert not has_counted(state, Pose2(HERE.x_m + 0.4, HERE.y_m, HERE.heading_rad))
    assert not has_counted(state, Pose2(HERE.x_m, HERE.y_m, HERE.heading_rad + 0.3))


@given(steps)
def test_nothing_is_known_better_than_what_lines_have_in_common(step: tuple[float, ...]) -> None:
    state = learn(TOLD, step, np.diag(np.full(7, 1e-20)), HERE)
    floors = [LEAST_SIGMA_RAD] * 3 + [LEAST_SIGMA_M, LEAST_SIGMA_FOCAL] + [LEAST_SIGMA_CENTRE_PX] * 2
    assert np.all(np.sqrt(np.diag(np.array(state.covariance))) >= np.array(floors) * (1.0 - 1e-9))
