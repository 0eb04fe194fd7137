"""Laws of how sure poses are: errors are as large as stated, with noise as stated and with more of it.

The normalised error squared over many noise draws is within its chi-square band (`tests/consistency.py`). A robust
solver leaves out what is too far off, so that what it keeps scatters less than the noise does.

How many draws: up to 50, which are 150 unknowns on the floor and 300 of a camera. An honest solver then fails once in a
thousand. On the floor one whose variances are too small by the factor 1.65, or too large by 1.7 (deviations by 30 %),
is found nine times in ten; a camera's noise is estimated from its own lines, which takes some of the band, and more
draws.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom

from consistency import assert_soon_consistent, build_hall, compute_error, compute_nees
from experiments.paper.pose_solvers import r_and_t, r_then_t, trunc_r_and_t
from knowledge_sources.methods.pose import (
    MARGINAL_SPREAD,
    OUTLIER_SIGMAS,
    POINT_OUTLIER_SIGMAS,
    PoseEstimate,
    estimate_camera_and_pose,
    med_r_and_t,
    planar,
    planar_from_lines,
    planar_from_points,
    r_and_t_ml,
)
from knowledge_sources.methods.pose.estimate import compute_mean_square, compute_spread
from world_models.building.model_errors import LineErrors
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2

CAMERA = Camera.from_field_of_view(np.radians(65.0))
MOUNT = CameraMount(1.0, 0.1, 0.05)
SIGMA_PX = 0.3
PRIOR = np.diag([0.2, 0.2, 0.05]) ** 2
NOISES = (1.0, 1.5, 2.0)
"""The true noise over the stated one."""
ESTIMATED = {1.0: 1.0, 1.5: 1.15, 2.0: 1.15}
"""By how much errors may exceed the stated ones where the noise is estimated from few residuals (Student's law)."""
ON_FLOOR, IN_SPACE = 50, 50
"""Draws of three and of six unknowns."""
Array = NDArray[np.float64]


class Draw:
    """A robot anywhere, what it sees of the hall, and what it believed before."""

    def __init__(self, seed: int, noise: float) -> None:
        self.rng = rng = np.random.default_rng(seed)
        self.truth = Pose2(4.0, -2.0, rng.uniform(-3.0, 3.0))
        here = self.truth.lifted()
        self.camera_from_world = MOUNT.camera_from_robot @ here.inverse()
        lines = here.apply(build_hall())
        segments, visible = CAMERA.project_segments(lines, self.camera_from_world)
        self.lines, self.segments = lines[visible], self.add_noise(segments[visible], noise)
        self.points = here.apply(rng.uniform((3.0, -1.2, 0.0), (9.0, 1.2, 2.2), (24, 3)))
        self.pixels = self.add_noise(CAMERA.project(self.camera_from_world.apply(self.points)), noise)
        off = rng.multivariate_normal(np.zeros(3), PRIOR)
        self.prior = Pose2(*(np.array([self.truth.x_m, self.truth.y_m, self.truth.heading_rad]) + off))

    def add_noise(self, px: Array, noise: float) -> Array:
        return px + self.rng.normal(0.0, noise * SIGMA_PX, px.shape)


def on_floor_from_lines(d: Draw) -> Any:
    return planar_from_lines(d.lines, d.segments, CAMERA, MOUNT.camera_from_robot, d.prior, prior_covariance=PRIOR,
                             sigma_px=SIGMA_PX)


def on_floor_from_lines_alone(d: Draw) -> Any:
    return planar_from_lines(d.lines, d.segments, CAMERA, MOUNT.camera_from_robot, d.prior, sigma_px=SIGMA_PX)


def on_floor_from_every_line(d: Draw) -> Any:
    return planar_from_lines(d.lines, d.segments, CAMERA, MOUNT.camera_from_robot, d.prior, prior_covariance=PRIOR,
                             sigma_px=SIGMA_PX, robust=False)


def on_floor_from_points(d: Draw) -> Any:
    return planar_from_points(d.points, d.pixels, CAMERA, MOUNT.camera_from_robot, d.prior, PRIOR, sigma_px=SIGMA_PX)


def compute_nees_on_floor(solve: Callable[[Draw], Any], d: Draw) -> float:
    found = solve(d)
    return compute_nees(compute_error(found.world_from_robot, d.truth), found.covariance)


@pytest.mark.parametrize("noise", NOISES)
@pytest.mark.parametrize(
    "solve", [on_floor_from_lines, on_floor_from_lines_alone, on_floor_from_every_line, on_floor_from_points])
def test_a_pose_on_the_floor_is_as_far_off_as_it_says(solve: Callable[[Draw], Any], noise: float) -> None:
    assert_soon_consistent(lambda seed: compute_nees_on_floor(solve, Draw(seed, noise)), ON_FLOOR, 3,
                           most=ESTIMATED[noise])


@pytest.mark.parametrize("solve", [on_floor_from_lines, on_floor_from_points])
def test_with_three_times_the_noise_it_is_hardly_too_sure(solve: Callable[[Draw], Any]) -> None:
    """A third of the right lines is then left out as wrong, and the cut hides most of the noise."""
    assert_soon_consistent(lambda seed: compute_nees_on_floor(solve, Draw(seed, 3.0)), ON_FLOOR, 3, most=2.0)


@pytest.mark.parametrize("noise", (1.0, 2.0))
@pytest.mark.parametrize("solve", [r_then_t, r_and_t, r_and_t_ml, med_r_and_t, trunc_r_and_t])
def test_a_camera_pose_is_as_far_off_as_it_says(solve: Callable[..., PoseEstimate], noise: float) -> None:
    def draw(seed: int) -> float:
        d = Draw(seed, noise)
        prior = d.camera_from_world.perturbed(d.rng.normal(0.0, 0.01, 3), d.rng.normal(0.0, 0.1, 3))
        found = solve(d.lines, d.segments, CAMERA, prior, sigma_px=SIGMA_PX, shared_px=0.0)
        off = found.camera_from_world @ d.camera_from_world.inverse()
        return compute_nees(np.concatenate([off.rotation_vector, off.translation]), found.covariance)

    assert_soon_consistent(draw, IN_SPACE, 6)


@pytest.mark.parametrize("solve", [r_and_t_ml, med_r_and_t])
def test_with_four_times_the_noise_no_pose_is_called_decided(solve: Callable[..., PoseEstimate]) -> None:
    ok = []
    for seed in range(20):
        d = Draw(seed, 4.0)
        ok.append(solve(d.lines, d.segments, CAMERA, d.camera_from_world, sigma_px=SIGMA_PX, shared_px=0.0).ok)
    assert np.mean(ok) <= 0.1


@pytest.mark.parametrize("noise", NOISES)
def test_a_pose_in_an_inexact_model_is_as_far_off_as_it_says(noise: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Walls and doors are displaced by what the model says of itself.

    The factor for segments of a wrong line, which none is here, covers noise that is larger than stated.
    """
    if noise == 1.0:  # every segment is of its line, and the prior is independent
        monkeypatch.setattr(planar, "MARGINAL_SPREAD", 1.0)
        monkeypatch.setattr(planar, "SHARED_PRIOR_FACTOR", 0.0)

    def draw(seed: int) -> float:
        d = Draw(seed, noise)
        shifts = np.zeros((6, len(d.lines), 3))
        for k in range(6):
            shifts[k, k::6] = d.rng.normal(0.0, 0.01, 3)
        model = LineErrors(tuple(str(k) for k in range(6)), shifts)
        true = model.displace(d.lines, d.rng.normal(size=6))
        segments = d.add_noise(CAMERA.project_segments(true, d.camera_from_world)[0], noise)
        found = planar_from_lines(d.lines, segments, CAMERA, MOUNT.camera_from_robot, d.prior, prior_covariance=PRIOR,
                                  sigma_px=SIGMA_PX, errors=model)
        return compute_nees(compute_error(found.world_from_robot, d.truth), found.covariance)

    surplus = 1.0 if noise == 1.0 else MARGINAL_SPREAD**2
    assert_soon_consistent(draw, ON_FLOOR, 3, most_surplus=surplus)


@pytest.mark.parametrize("noise", NOISES)
def test_a_pose_with_the_camera_is_as_far_off_as_it_says(noise: float) -> None:
    camera_sigma = np.array([0.01, 0.01, 1e-6, 0.01, 0.01, 0.1, 0.1])

    def draw(seed: int) -> float:
        d = Draw(seed, noise)
        found = estimate_camera_and_pose(d.lines, d.segments, CAMERA, MOUNT, d.prior, PRIOR, np.diag(camera_sigma**2),
                                         sigma_px=SIGMA_PX)
        return compute_nees(compute_error(found.world_from_robot, d.truth), found.pose_covariance)

    assert_soon_consistent(draw, ON_FLOOR, 3, most_surplus=1.5)


@pytest.mark.parametrize("solve", [on_floor_from_lines, on_floor_from_points])
def test_as_many_right_ones_are_left_out_as_the_bound_says(solve: Callable[[Draw], Any]) -> None:
    """Of pairs of residuals of the normal law the part exp(-bound / 2) is beyond the bound on their squares."""
    bound = 2.0 * OUTLIER_SIGMAS**2 if solve is on_floor_from_lines else POINT_OUTLIER_SIGMAS**2
    for noise in (1.0, 1.5, 2.0):
        kept = np.concatenate([solve(Draw(seed, noise)).inliers for seed in range(ON_FLOOR)])
        out = int(np.count_nonzero(~kept))
        part = np.exp(-0.5 * bound / noise**2)
        low, high = binom.ppf((1e-3, 1.0 - 1e-3), len(kept), part)
        assert 0.6 * low <= out <= 1.6 * high + 1, f"{out} of {len(kept)} are left out, expected {part:.2%}"


@pytest.mark.parametrize(("sigmas", "is_kept"), [(0.95, True), (1.05, False)])
def test_one_line_just_within_and_just_beyond_the_bound(sigmas: float, is_kept: bool) -> None:
    """Both ends of one upright moved across by a part of the largest distance; all other lines are exact."""
    d = Draw(0, 0.0)
    level = np.ptp(d.segments[..., 0], axis=1) < 1.0
    one = int(np.flatnonzero(level)[0])
    each_px = sigmas * OUTLIER_SIGMAS * SIGMA_PX
    d.segments[one, :, 0] += each_px
    found = planar_from_lines(d.lines, d.segments, CAMERA, MOUNT.camera_from_robot, d.truth,
                              prior_covariance=np.diag([1e-8] * 3), sigma_px=SIGMA_PX)
    assert bool(found.inliers[one]) is is_kept and np.count_nonzero(found.inliers) >= len(d.lines) - 1


@pytest.mark.parametrize("variance", [1.0, 2.0, 4.0, 9.0])
def test_trimmed_noise_by_drawing_it(variance: float) -> None:
    """Mean square of what is kept, and the spread of the mean of kept ones (a place in the plane), by Monte Carlo."""
    rng, bound, count = np.random.default_rng(1), 18.0, 400
    kept = rng.normal(0.0, np.sqrt(variance), (200_000, 2))
    kept = kept[np.sum(kept**2, axis=1) <= bound]
    mean = compute_mean_square(variance, bound)
    assert np.mean(kept**2) == pytest.approx(mean, rel=0.01)
    centres = []
    for _ in range(400):
        drawn, at = rng.normal(0.0, np.sqrt(variance), (count, 2)), np.zeros(2)
        for _ in range(30):
            near = np.sum((drawn - at) ** 2, axis=1) <= bound
            at = drawn[near].mean(axis=0)
        centres.append(at * np.sqrt(np.count_nonzero(near)))
    if variance <= 4.0:  # at more noise the limit of many residuals is far
        assert np.mean(np.square(centres)) == pytest.approx(compute_spread(mean, bound, 16.0), rel=0.2)
    assert compute_spread(mean, bound, 16.0) == pytest.approx(variance**2 / mean, rel=1e-6)
