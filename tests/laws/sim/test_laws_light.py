"""Laws of light that is even, and of a camera that adapts; of baked light: extras/harvey-light/tests."""

from __future__ import annotations

import hashlib
import math
from itertools import pairwise
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from box_rooms import box_room
from sim.render.auto_exposure import MAX_GAIN, MIN_GAIN, TARGET, AutoExposure, vignette
from sim.render.lighting import GAMMA, UNEVEN, Lighting
from sim.render.lights import Lights, Room
from sim.render.renderer import Renderer
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose, Pose2

CAMERA = Camera.from_field_of_view(math.radians(65.0), 192, 160)
MOUNT = CameraMount(1.0, 0.1)
ROOM = Room(np.array([(0.0, 0.0), (6.0, 0.0), (6.0, 4.0), (0.0, 4.0)]), 0.0, 2.6)
places_of_robot = st.tuples(st.floats(0.5, 3.2), st.floats(1.2, 3.0), st.floats(-3.2, 3.2))


def camera_at(place: tuple[float, float, float]) -> Pose:
    return MOUNT.camera_from_robot @ Pose2(*place).lifted().inverse()


def test_without_light_pictures_are_as_they_were_before_there_was_light() -> None:
    camera = Camera.from_field_of_view(math.radians(65.0), 256, 256)
    pose = CameraMount(1.0, 0.1).camera_from_robot @ Pose2(1.0, 1.0, 0.4).lifted().inverse()
    image = Renderer.of_faces(box_room()).image(camera, pose)
    found = hashlib.sha256(image.tobytes()).hexdigest()
    assert found == "c0d85bb900ce5bdac25bc61dbacdd46f2ba9329d5e299195d82ec9944aeeed33"


@settings(deadline=None, max_examples=15)
@given(places_of_robot, st.floats(0.0, 1.0))
def test_flat_light_dims_the_picture_without_light(place: tuple[float, float, float], flat: float) -> None:
    dim = Lights(Lighting(flat=flat, lamps=0.0), (ROOM,)).renderer(box_room()[:-2]).with_faces(box_room()[-2:])
    plain, lit = (r.radiance(CAMERA, camera_at(place)) for r in (Renderer.of_faces(box_room()), dim))
    np.testing.assert_allclose(lit, plain * flat ** (1.0 / GAMMA), atol=1e-4)


@given(st.fixed_dictionaries({key: st.sampled_from([0, 1]) for key in UNEVEN}))
def test_light_is_uneven_by_what_it_has_besides_flat_light(values: dict[str, Any]) -> None:
    assert set(Lighting(flat=1.0, **values).uneven) == {key for key, value in values.items() if value}


@settings(deadline=None, max_examples=30)
@given(st.floats(0.02, 3.0), st.floats(0.1, 5.0), st.floats(0.02, 1.0))
def test_auto_exposure_converges_to_the_steady_value(brightness: float, lag_s: float, step_s: float) -> None:
    radiance = np.full((32, 32, 3), brightness, np.float32)
    state = AutoExposure(lag_s, 0.0)
    settled = state.settle(radiance, 1.0)
    steady = min(max(TARGET / brightness, MIN_GAIN), MAX_GAIN)
    assert settled.gain == pytest.approx(steady, rel=0.01)
    gaps, time_s = [], 0.0
    while time_s < 12.0 * lag_s:
        time_s += step_s
        level = np.uint8(round(255.0 * min(1.0, brightness * state.gain)))
        done, jpeg = cv2.imencode(".png", np.full((32, 32, 3), level))
        assert done
        state = state.after(jpeg.tobytes(), time_s)
        gaps.append(abs(math.log(state.gain / steady)))
    assert gaps[-1] < 0.05
    assert all(later <= earlier + 0.02 for earlier, later in pairwise(gaps)), "it does not swing"


@settings(deadline=None, max_examples=20)
@given(st.floats(0.5, 1.0), st.floats(0.5, 1.0))
def test_white_balance_makes_a_tinted_picture_grey(red: float, blue: float) -> None:
    radiance = 0.4 * np.ones((32, 32, 3), np.float32) * np.array([red, 1.0, blue], np.float32)
    seen = radiance[0, 0] * AutoExposure(0.5, 0.5).settle(radiance, 1.0).gains
    bound_red, bound_blue = red * 1.4, blue * 1.4
    assert seen[0] == pytest.approx(seen[1] * min(1.0, bound_red), rel=0.03)
    assert seen[2] == pytest.approx(seen[1] * min(1.0, bound_blue), rel=0.03)


@given(st.integers(8, 99), st.integers(8, 99), st.floats(0.0, 1.0))
def test_vignetting_darkens_towards_the_corners_only(height: int, width: int, strength: float) -> None:
    factor = vignette(height, width, strength)[..., 0]
    assert factor.max() <= 1.0 and factor[height // 2, width // 2] > (1.0 - strength * 0.04) ** (1.0 / GAMMA) - 1e-6
    assert factor[0, 0] == factor.min() >= (1.0 - strength) ** (1.0 / GAMMA) - 1e-6
