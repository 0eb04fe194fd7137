"""Lens distortion: what is bent is straightened again, the simulator's model is the robot's, and both are OpenCV's."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from box_rooms import box_room
from knowledge_sources.methods.features import Rectifier
from sim.render.optics import Optics, distort, undistort
from sim.render.renderer import Renderer
from sim.scenario import ScenarioError, load_scenario, with_settings
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2
from world_models.robot import RobotModel

PLAIN = Camera(400.0, 404.0, 250.0, 259.0, 512, 512)


@st.composite
def lenses(draw: st.DrawFn) -> Camera:
    """Lenses of cameras as they are used indoors: barrel to slight pincushion."""
    terms = [draw(st.floats(-size, size)) for size in (0.08, 0.002, 0.002, 0.01)]
    k1 = draw(st.floats(-0.3, 0.1))
    return replace(PLAIN, distortion=(k1, *terms))


def straightened_or_none(behind: np.ndarray, k: np.ndarray) -> np.ndarray:
    try:
        return undistort(behind, k)
    except ValueError:
        reject()


pixels = st.lists(st.tuples(st.floats(0.0, 511.0), st.floats(0.0, 511.0)), min_size=1, max_size=8).map(np.array)


@settings(max_examples=60, deadline=None)
@given(lenses(), pixels)
def test_undone_distortion_comes_back(lens: Camera, px: np.ndarray) -> None:
    straightened_or_none((px - (lens.cx, lens.cy)) / (lens.fx, lens.fy), np.asarray(lens.distortion))
    np.testing.assert_allclose(lens.project(PLAIN.rays(lens.undistort(px))), px, atol=1e-3)


@settings(max_examples=60, deadline=None)
@given(lenses(), pixels)
def test_opencv_bends_the_same_way(lens: Camera, px: np.ndarray) -> None:
    rays = PLAIN.rays(px)
    theirs = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), lens.matrix, np.asarray(lens.distortion))[0]
    np.testing.assert_allclose(lens.project(rays), np.asarray(theirs).reshape(-1, 2), atol=1e-9)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(-0.1, 0.1), min_size=8, max_size=8), pixels)
def test_the_simulator_bends_by_eight_terms_as_opencv_does(terms: list[float], px: np.ndarray) -> None:
    rays = PLAIN.rays(px)
    theirs = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), np.eye(3), np.array(terms))[0].reshape(-1, 2)
    np.testing.assert_allclose(distort(rays[..., :2], np.array(terms))[0], theirs, atol=1e-9)
    np.testing.assert_allclose(undistort(theirs, np.array(terms)), rays[..., :2], atol=1e-9)


@settings(max_examples=60, deadline=None)
@given(lenses(), pixels)
def test_the_simulator_s_lens_is_the_robot_s(lens: Camera, px: np.ndarray) -> None:
    k = np.asarray(lens.distortion)
    behind = (px - (lens.cx, lens.cy)) / (lens.fx, lens.fy)
    before = straightened_or_none(behind, k)
    np.testing.assert_allclose(distort(before, k)[0], behind, atol=1e-9)
    np.testing.assert_allclose(lens.project(np.column_stack([before, np.ones(len(before))])), px, atol=1e-6)


@settings(max_examples=30, deadline=None)
@given(lenses())
def test_the_picture_without_distortion_is_filled(lens: Camera) -> None:
    """Every pixel of it lies in the picture as it came."""
    pinhole = lens.pinhole
    assert pinhole.distortion is None and (pinhole.width, pinhole.height) == (512, 512)
    assert pinhole.fx >= lens.fx
    assert np.all(lens.inside(lens.project(pinhole.rays(pinhole.border())), -0.5))


@pytest.mark.parametrize("distortion", [(-0.2, 0.05, 0.001, -0.0005), (0.08, 0.0, 0.0, 0.0)])
def test_a_bent_picture_straightened_is_the_plain_one(distortion: tuple[float, ...]) -> None:
    """The whole way: rendered through the lens, and undone by the other model, against the renderer's pinhole."""
    lens = replace(PLAIN, distortion=distortion)
    pose = CameraMount(1.0, 0.1).camera_from_robot @ Pose2(0.8, 2.0, 0.1).lifted().inverse()
    renderer = Renderer.of_faces(box_room())
    ideal = renderer.radiance(lens.pinhole, pose)[..., 1]
    raw = Optics.of(lens).radiance(renderer, pose)
    seen = Rectifier(lens, lens.pinhole).rectify(np.ascontiguousarray((raw * 255.0 + 0.5).astype(np.uint8)))[..., 1]
    inner = np.s_[8:-8, 8:-8]
    (dx, dy), response = cv2.phaseCorrelate(ideal[inner].astype(np.float64), seen[inner].astype(np.float64))
    assert abs(dx) < 0.05 and abs(dy) < 0.05 and response > 0.9
    apart, before = (float(np.mean(np.abs(255.0 * ideal - image)[inner])) for image in (seen, 255.0 * raw[..., 1]))
    assert apart < 1.5 and before > 2.0 * apart


def test_a_robot_sees_in_straightened_pixels(world_of_nothing: RobotModel) -> None:
    robot = world_of_nothing
    assert robot.lens.distortion is not None and robot.camera.distortion is None
    again = replace(robot, radius_m=0.2)
    assert again.lens is robot.lens and again.camera.distortion is None


@pytest.fixture
def world_of_nothing() -> RobotModel:
    from world_models.actuator import ActuatorModel
    from world_models.files.world_files import WORLDS, load_world

    lens = replace(PLAIN, distortion=(-0.2, 0.05, 0.0, 0.0))
    return RobotModel(load_world(WORLDS / "research_center.toml"), lens, CameraMount(1.0), ActuatorModel())


def test_a_lens_that_folds_the_picture_is_refused() -> None:
    with pytest.raises(ValueError, match="expected a distortion that has one ray for every pixel"):
        Optics.of(replace(PLAIN, distortion=(-0.9, 0.0, 0.0, 0.0)))


def test_a_picture_of_another_size_is_refused() -> None:
    lens = replace(PLAIN, distortion=(-0.2, 0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="expected a picture of 512 x 512 px"):
        Rectifier(lens, lens.pinhole).rectify(np.zeros((480, 640), np.uint8))


def test_a_scenario_may_have_a_lens() -> None:
    scenario = with_settings(load_scenario("forty-foot-hallway"), {"camera.distortion": "[-0.2, 0.05, 0.0, 0.0]"})
    np.testing.assert_array_equal(scenario.camera.camera.distortion, (-0.2, 0.05, 0.0, 0.0, 0.0))
    with pytest.raises(ScenarioError, match="expected 4 or 5 finite distortion coefficients"):
        with_settings(scenario, {"camera.distortion": "[-0.2]"})
    with pytest.raises(ScenarioError, match="one ray for every pixel"):
        with_settings(scenario, {"camera.distortion": "[-0.9, 0.0, 0.0, 0.0]"})
