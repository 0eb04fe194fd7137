"""Laws of putting the belief right by the model's edges, on rendered pictures of the research center."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from harvey.simulation.run import robot_model
from knowledge_sources.methods.features.images import decode
from knowledge_sources.methods.motion.routes import compute_free_space
from knowledge_sources.methods.tracking.edge_alignment import EdgeAlignment, align_to_edges
from sim.render.optics import Optics
from sim.render.sensor import compress_jpeg, expose
from sim.scenario import load_scenario
from sim.stage import Stage, set_stage
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel
from world_models.visibility.lines_and_points import visible_lines

Floats = NDArray[np.float64]
few = settings(max_examples=30, deadline=None)
seeds = st.integers(0, 2**32 - 1)
ROOMS = ("hallway", "robot-laboratory", "library", "allens-office", "conference-room", "machine-room")


@cache
def stage() -> Stage:
    return set_stage(load_scenario("lab-to-allens-office"))


@cache
def robot() -> RobotModel:
    return robot_model(stage().scenario)


def somewhere(rng: np.random.Generator) -> Pose2:
    """Where a robot may stand, in some room."""
    world, room = robot().world, str(rng.choice(ROOMS))
    free = compute_free_space(world.outline(room), world.obstacles(room), robot().radius_m)
    low, high = np.array(free.bounds).reshape(2, 2)
    while not free.covers(shapely.Point(at := rng.uniform(low, high))):
        pass
    return Pose2(float(at[0]), float(at[1]), float(rng.uniform(-math.pi, math.pi)))


def picture(pose: Pose2, rng: np.random.Generator) -> NDArray[np.uint8]:
    s = stage().scenario
    radiance = Optics.of(s.camera.camera).radiance(stage().building.renderer, robot().camera_from_world(pose))
    return decode(compress_jpeg(expose(radiance, s.sensor, rng, lights_on=True), s.sensor.jpeg_quality))


def drawn(pose: Pose2, sigmas: tuple[float, float, float], rng: np.random.Generator) -> tuple[Pose2, Floats]:
    """A belief that is wrong as its covariance says, by three deviations at the most.

    The deviations are along a direction, across it, and of heading.
    """
    angle = rng.uniform(0.0, math.pi)
    turn = np.array([[math.cos(angle), -math.sin(angle), 0.0], [math.sin(angle), math.cos(angle), 0.0], [0, 0, 1.0]])
    covariance = turn @ np.diag(np.square(sigmas)) @ turn.T
    away = rng.multivariate_normal(np.zeros(3), covariance)
    away *= min(1.0, 3.0 / math.sqrt(away @ np.linalg.solve(covariance, away)))
    return Pose2(pose.x_m + away[0], pose.y_m + away[1], wrap_angle(pose.heading_rad + away[2])), covariance


def told(belief: Pose2, covariance: Floats, image: NDArray[np.uint8]) -> EdgeAlignment | None:
    lines = visible_lines(robot().world, robot().camera, robot().camera_from_world(belief), min_length_px=16.0,
                          min_contrast=0.05, max_distance_m=15.0)
    return align_to_edges(robot(), image, lines.lines_world, belief, covariance)


def off(one: Pose2, other: Pose2) -> Floats:
    return np.array([one.x_m - other.x_m, one.y_m - other.y_m, wrap_angle(one.heading_rad - other.heading_rad)])


def test_however_loose_the_belief_was_it_is_no_further_off_than_it_says() -> None:
    """In 95 of 100 cases within three deviations. Where the next edge need not be a line's own it says nothing."""
    rng = np.random.default_rng(11)
    off_by = []
    for loose in np.linspace(0.0, 1.0, 300) ** 3:
        true = somewhere(rng)
        sigmas = (0.003 + 0.02 * loose, 0.003 + 0.01 * loose, math.radians(0.15 + 1.7 * loose))
        belief, covariance = drawn(true, sigmas, rng)
        found = told(belief, covariance, picture(true, rng))
        if found is not None:
            error = off(found.world_from_robot, true)
            assert np.linalg.eigvalsh(found.covariance).min() > 0.0
            off_by.append(math.sqrt(error @ np.linalg.solve(found.covariance, error)))
    assert len(off_by) >= 30
    assert np.mean(np.array(off_by) <= 3.0) >= 0.95


def test_a_belief_that_is_nearly_right_is_put_right_to_a_millimetre_or_so() -> None:
    """In most rooms and directions; half of all errors are below a millimetre, and headings below 0.03 degrees."""
    rng = np.random.default_rng(7)
    errors = []
    for _ in range(60):
        true = somewhere(rng)
        belief, covariance = drawn(true, (0.003, 0.003, math.radians(0.15)), rng)
        found = told(belief, covariance, picture(true, rng))
        if found is not None:
            errors.append(np.abs(off(found.world_from_robot, true)))
    assert len(errors) >= 20
    x_m, y_m, heading_rad = np.median(errors, axis=0)
    assert math.hypot(x_m, y_m) < 0.001 and heading_rad < math.radians(0.03)


@few
@given(seed=seeds)
def test_a_blank_picture_tells_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    belief, covariance = drawn(somewhere(rng), (0.003, 0.003, math.radians(0.15)), rng)
    assert told(belief, covariance, np.full((512, 512), int(rng.integers(256)), np.uint8)) is None


@pytest.mark.parametrize("loose", [0.05, 0.2])
def test_a_belief_far_too_loose_is_left_alone(loose: float) -> None:
    rng = np.random.default_rng(1)
    for _ in range(10):
        true = somewhere(rng)
        assert told(true, np.diag(np.square([loose, loose, loose])), picture(true, rng)) is None
