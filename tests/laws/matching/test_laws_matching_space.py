"""Laws of matching with six unknowns, and of locating a camera with it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import least_squares

from experiments.perception.locate_camera import CameraFix, PoseVerdict, locate_camera
from knowledge_sources.methods.matching import PoseMatch, match_in_space
from knowledge_sources.methods.matching.pose_matching import POSE_SIGMA_PX
from world_models.camera import Camera
from world_models.frames import Pose

Array = NDArray[np.float64]

CAMERA = Camera.from_field_of_view(np.radians(60.0))
SPREAD = np.diag([0.02**2] * 3 + [0.15**2] * 3)
seeds = st.integers(0, 2**32 - 1)
few = settings(max_examples=8, deadline=None, derandomize=True)


def build_hall() -> Array:
    """Long edges and unevenly spaced doors ahead of the camera, its own axes (n, 2, 3)."""
    lines = [[[x, y, 2.0], [x, y, 18.0]] for x in (-1.2, 1.2) for y in (-1.4, 1.0)]
    for z, x in ((3.6, -1.2), (4.3, 1.2), (6.3, -1.2), (7.4, 1.2), (10.2, -1.2), (12.9, 1.2)):
        lines += [[[x, 1.0, a], [x, -1.1, a]] for a in (z, z + 0.9)]
        lines.append([[x, -1.1, z], [x, -1.1, z + 0.9]])
    return np.array([*lines, [[-1.2, 1.0, 18.0], [1.2, 1.0, 18.0]], [[-1.2, -1.4, 18.0], [1.2, -1.4, 18.0]]])


def scene(seed: int, clutter: int = 60) -> tuple[Array, Pose, Pose, np.random.Generator]:
    """Data lines (k, 2, 2), the true pose, a prior off by up to 2 deviations, and the generator."""
    rng = np.random.default_rng(seed)
    truth = Pose.from_rotation_vector(rng.uniform(-0.05, 0.05, 3), rng.uniform(-0.3, 0.3, 3))
    seen, visible = CAMERA.project_segments(build_hall(), truth)
    seen = seen[visible]
    span = seen[:, 1] - seen[:, 0]
    parts = [np.stack([seen[:, 0] + a * span, seen[:, 0] + b * span], axis=1) for a, b in ((0.02, 0.45), (0.55, 0.98))]
    start, angle = rng.uniform(0.0, 511.0, (clutter, 2)), rng.uniform(0.0, np.pi, clutter)
    length = rng.exponential(25.0, (clutter, 1)) + 8.0
    noise = np.stack([start, start + length * np.stack([np.cos(angle), np.sin(angle)], axis=1)], axis=1)
    data = np.concatenate([*parts, noise])
    off = np.sqrt(np.diag(SPREAD)) * rng.uniform(-1.5, 1.5, 6)
    return data + rng.normal(0.0, 0.2, data.shape), truth, truth.perturbed(off[:3], off[3:]), rng


def measure_distance(found: Pose, other: Pose) -> float:
    """The larger of the distance between the cameras [m] and 10 times the turn [rad]."""
    shift = np.linalg.norm(found.inverse().translation - other.inverse().translation)
    return max(float(shift), 10.0 * found.angle_to(other))


def match(lines: Array, data: Array, prior: Pose) -> PoseMatch:
    return match_in_space(lines, data, CAMERA, prior, SPREAD)


@given(seed=seeds)
@few
def test_a_disturbed_pose_is_found_again(seed: int) -> None:
    data, truth, prior, _ = scene(seed)
    found = match(build_hall(), data, prior)
    assert measure_distance(found.camera_from_world, truth) < 0.06
    assert len(np.unique(found.pairs[:, 1])) == len(found.pairs)
    assert [tuple(p) for p in found.pairs] == sorted(tuple(p) for p in found.pairs)


@given(seed=seeds)
@few
def test_the_order_of_lines_and_ends_does_not_matter(seed: int) -> None:
    data, _, prior, rng = scene(seed)
    rows, columns = rng.permutation(len(build_hall())), rng.permutation(len(data))
    first = match(build_hall(), data, prior)
    second = match(build_hall()[rows][:, ::-1], data[columns][:, ::-1], prior)
    assert {(int(rows[m]), int(columns[d])) for m, d in second.pairs} == {(int(m), int(d)) for m, d in first.pairs}
    assert second.e_match == pytest.approx(first.e_match, rel=1e-6)


@given(seed=seeds)
@few
def test_moving_the_world_changes_nothing(seed: int) -> None:
    """Model and pose together: what the camera sees is the same."""
    data, _, prior, rng = scene(seed)
    move = Pose.from_rotation_vector(rng.uniform(-2.0, 2.0, 3), rng.uniform(-20.0, 20.0, 3))
    first = match(build_hall(), data, prior)
    second = match(move.apply(build_hall()), data, prior @ move.inverse())
    assert np.array_equal(first.pairs, second.pairs)
    assert measure_distance(second.camera_from_world @ move, first.camera_from_world) < 1e-6


def test_nothing_seen_leaves_the_prior() -> None:
    found = match(build_hall(), np.zeros((0, 2, 2)), Pose.identity())
    assert found.pairs.shape == (0, 2) and not found.coverage.any()
    assert measure_distance(found.camera_from_world, Pose.identity()) < 1e-9


def test_no_model_line_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one model line"):
        match(np.zeros((0, 2, 3)), np.zeros((0, 2, 2)), Pose.identity())
    with pytest.raises(ValueError, match=r"shape \(6, 6\)"):
        match_in_space(build_hall(), np.zeros((0, 2, 2)), CAMERA, Pose.identity(), np.eye(3))


def locate(image: NDArray[np.uint8], prior: Pose, rng: np.random.Generator) -> CameraFix | None:
    return locate_camera(build_hall(), image, CAMERA, prior, SPREAD, tolerance_m=0.05, tolerance_rad=0.005, rng=rng)


def draw_edges(segments: Array) -> NDArray[np.uint8]:
    """A picture in which each segment is the edge of a bright band."""
    v, u = np.mgrid[0:512, 0:512]
    image = np.full((512, 512), 60.0)
    for a, b in segments:
        along = (b - a) / np.linalg.norm(b - a)
        t, o = (u - a[0]) * along[0] + (v - a[1]) * along[1], (v - a[1]) * along[0] - (u - a[0]) * along[1]
        image += 90.0 * np.clip(o + 0.5, 0.0, 1.0) * np.clip(4.0 - o, 0.0, 1.0) * (
            (t >= 0.0) & (t <= np.linalg.norm(b - a))
        )
    return np.asarray(np.clip(image, 0.0, 255.0), np.uint8)


@given(seed=seeds)
@settings(max_examples=3, deadline=None, derandomize=True)
def test_what_is_verified_is_right_and_another_picture_is_not_verified(seed: int) -> None:
    _, truth, prior, rng = scene(seed)
    seen, visible = CAMERA.project_segments(build_hall(), truth)
    here = locate(draw_edges(seen[visible]), prior, rng)
    assert here is not None and here.verdict is PoseVerdict.VERIFIED
    assert measure_distance(here.camera_from_world, truth) < 0.05
    lines = rng.uniform(30.0, 480.0, (30, 2, 2))
    elsewhere = locate(draw_edges(lines), prior, rng)
    assert elsewhere is None or elsewhere.verdict is not PoseVerdict.VERIFIED


def test_an_empty_picture_gives_no_pose() -> None:
    image = np.full((512, 512), 90, np.uint8)
    assert locate(image, Pose.identity(), np.random.default_rng(0)) is None


@given(seed=seeds, part=st.sampled_from((1e-2, 1e-3, 1e-4)))
@few
def test_the_prior_pulls_the_pose_towards_itself_by_as_much_as_it_is_tight(seed: int, part: float) -> None:
    """The pairs that were chosen and the prior, each by its deviation: least squares find the same, to a tenth."""
    data, _, prior, _ = scene(seed)
    found = match_in_space(build_hall(), data, CAMERA, prior, SPREAD * part)
    lines, seen, sigmas = build_hall()[found.pairs[:, 0]], data[found.pairs[:, 1]], np.sqrt(np.diag(SPREAD * part))

    def pull(step: Array) -> Array:
        px = CAMERA.project((prior.perturbed(step[:3] * sigmas[:3], step[3:] * sigmas[3:])).apply(lines))
        by, off = px[:, 1] - px[:, 0], seen - px[:, :1]
        across = (by[:, None, 0] * off[..., 1] - by[:, None, 1] * off[..., 0]) / np.linalg.norm(by, axis=1)[:, None]
        return np.concatenate([across.ravel() / POSE_SIGMA_PX, step])

    wanted, apart = least_squares(pull, np.zeros(6)).x, found.camera_from_world @ prior.inverse()
    step = np.concatenate([apart.rotation_vector, apart.translation]) / sigmas
    assert np.linalg.norm(step - wanted) < 0.1 * np.linalg.norm(wanted) + 1e-3
