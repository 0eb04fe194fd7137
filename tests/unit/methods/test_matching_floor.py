"""Matching with the three unknowns of a robot on the floor, where perspective bends the prediction."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from knowledge_sources.methods.matching import match_on_floor
from knowledge_sources.methods.pose import planar_from_lines
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2, wrap_angle

CAMERA = Camera.from_field_of_view(np.radians(65.0))
MOUNT = CameraMount(1.0, 0.1).camera_from_robot
PRIOR = np.diag([0.15, 0.15, 0.05]) ** 2
Array = NDArray[np.float64]


def build_hall() -> Array:
    """Long edges and unevenly spaced doors (n, 2, 3)."""
    lines = [[[1.5, y, z], [18.0, y, z]] for y in (-1.2, 1.2) for z in (0.0, 2.4)]
    for x, y in ((2.6, -1.2), (4.1, 1.2), (6.3, -1.2), (7.0, 1.2), (10.2, -1.2), (12.9, 1.2)):
        lines += [[[x, y, 0.0], [x, y, 2.1]], [[x + 0.9, y, 0.0], [x + 0.9, y, 2.1]], [[x, y, 2.1], [x + 0.9, y, 2.1]]]
    return np.array([*lines, [[18.0, -1.2, 0.0], [18.0, 1.2, 0.0]], [[18.0, -1.2, 2.4], [18.0, 1.2, 2.4]]])


def draw_picture(truth: Pose2, seed: int, clutter: int = 80) -> Array:
    """Two fragments of each visible line, and clutter (k, 2, 2)."""
    rng = np.random.default_rng(seed)
    segments, visible = CAMERA.project_segments(build_hall(), MOUNT @ truth.lifted().inverse())
    seen = segments[visible]
    span = seen[:, 1] - seen[:, 0]
    halves = [np.stack([seen[:, 0] + a * span, seen[:, 0] + b * span], axis=1) for a, b in ((0.02, 0.45), (0.55, 0.98))]
    start, angle = rng.uniform(0.0, 511.0, (clutter, 2)), rng.uniform(0.0, np.pi, clutter)
    length = rng.exponential(30.0, (clutter, 1)) + 10.0
    noise = np.stack([start, start + length * np.stack([np.cos(angle), np.sin(angle)], axis=1)], axis=1)
    data = np.concatenate([*halves, noise])
    return rng.permutation(data + rng.normal(0.0, 0.3, data.shape))


def predict_lines(prior: Pose2) -> Array:
    lines = build_hall()
    _, visible = CAMERA.project_segments(lines, MOUNT @ prior.lifted().inverse())
    return lines[visible]


@pytest.mark.parametrize("seed", range(6))
def test_match_and_pose_are_found_from_a_prior_a_third_of_a_metre_off(seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    truth = Pose2(rng.uniform(0.0, 1.5), rng.uniform(-0.4, 0.4), rng.uniform(-0.15, 0.15))
    dx, dy, turn = rng.uniform(-1.0, 1.0, 3) * (0.3, 0.3, 0.1)
    prior = Pose2(truth.x_m + dx, truth.y_m + dy, truth.heading_rad + turn)
    data = draw_picture(truth, seed)
    lines = predict_lines(prior)
    match = match_on_floor(lines, data, CAMERA, MOUNT, prior, PRIOR)
    found = planar_from_lines(
        lines[match.pairs[:, 0]], data[match.pairs[:, 1]], CAMERA, MOUNT, match.world_from_robot, sigma_px=0.5
    )
    assert found.world_from_robot.distance_to(truth) < 0.01
    assert abs(wrap_angle(found.world_from_robot.heading_rad - truth.heading_rad)) < 0.002
    assert len(np.unique(match.pairs[:, 1])) == len(match.pairs)


def test_nothing_seen_leaves_the_prior() -> None:
    prior = Pose2(0.2, 0.1, 0.05)
    match = match_on_floor(build_hall(), np.zeros((0, 2, 2)), CAMERA, MOUNT, prior, PRIOR)
    assert match.pairs.shape == (0, 2)
    assert match.world_from_robot.distance_to(prior) < 1e-9
    assert not match.coverage.any()


def test_no_model_line_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one model line"):
        match_on_floor(np.zeros((0, 2, 3)), np.zeros((0, 2, 2)), CAMERA, MOUNT, Pose2(0.0, 0.0, 0.0), PRIOR)
