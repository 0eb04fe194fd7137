"""Laws of what a view is worth: the deviations that it promises and the odds of its lines, against scipy's numbers."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.optimize import approx_fprime
from scipy.stats import beta

from knowledge_sources.methods.verification import compute_log_ratio, compute_view_quality, line_check
from knowledge_sources.methods.verification.line_check import EPSILON_INFORMATION
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2

CAMERA = Camera.from_field_of_view(math.radians(65.0))
MOUNT = CameraMount(1.0, 0.1)
Floats = NDArray[np.float64]
seeds = st.integers(0, 2**32 - 1)
some = settings(max_examples=60, deadline=None)


def draw_lines_ahead(rng: np.random.Generator, pose: Pose2, count: int) -> Floats:
    """(count, 2, 3) lines of any direction in front of the robot [m, world]."""
    foot = np.stack([rng.uniform(2.0, 6.0, count), rng.uniform(-1.0, 1.0, count), rng.uniform(0.3, 1.5, count)], axis=1)
    lines = np.stack([foot, foot + rng.uniform(-0.6, 0.6, (count, 3))], axis=1)
    return np.asarray(pose.lifted().apply(lines))


@some
@given(seed=seeds, count=st.integers(1, 12), sigma_px=st.floats(0.2, 3.0))
def test_a_view_promises_the_bound_of_its_lines_by_finite_differences(seed: int, count: int, sigma_px: float) -> None:
    rng = np.random.default_rng(seed)
    pose = Pose2(*rng.uniform(-5.0, 5.0, 2), rng.uniform(-math.pi, math.pi))
    lines = draw_lines_ahead(rng, pose, count)

    def project(state: Floats) -> Floats:
        return CAMERA.project((MOUNT.camera_from_robot @ Pose2(*state).lifted().inverse()).apply(lines))

    state = np.array([pose.x_m, pose.y_m, pose.heading_rad])
    along = np.diff(project(state), axis=1)[:, 0]
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    slopes = approx_fprime(state, lambda s: np.einsum("nej,nj->ne", project(s), normal).ravel(), 1e-7)
    covariance = np.linalg.inv(slopes.T @ slopes / sigma_px**2 + EPSILON_INFORMATION * np.eye(3))
    found = compute_view_quality(lines, CAMERA, MOUNT.camera_from_robot, pose, sigma_px)
    worst = math.sqrt(np.linalg.norm(covariance[:2, :2], 2))
    assert found.lines == count
    if worst < 50.0:  # what no line fixes is left to rounding
        assert math.isclose(found.sigma_m, worst, rel_tol=1e-2)
        assert math.isclose(found.sigma_rad, math.sqrt(covariance[2, 2]), rel_tol=1e-2)


@some
@given(visible=st.integers(0, 60), part=st.floats(0.0, 1.0), chance=st.floats(0.0, 1.0))
def test_matched_lines_are_worth_their_odds_whatever_part_of_them_a_picture_shows(
    visible: int, part: float, chance: float
) -> None:
    matched = round(part * visible)
    p = float(np.clip(chance, *line_check.CERTAINTY_BOUNDS))
    worth = line_check.LINE_INDEPENDENCE

    def odds(rate: float) -> float:
        found, missed = worth * matched, worth * (visible - matched)
        here, elsewhere = (found * math.log(r) + missed * math.log(1.0 - r) for r in (rate, p))
        return math.exp(here - elsewhere) * float(beta.pdf(rate, *line_check.FOUND_AND_MISSED))

    mean = quad(odds, 1e-12, 1.0 - 1e-12, points=[0.5, max(0.01, min(0.99, part))], limit=200)[0]
    assert math.isclose(compute_log_ratio(matched, visible, chance), math.log(mean), abs_tol=1e-5)
