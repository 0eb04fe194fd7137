"""Laws of the protection level: no single false thing moves a pose beyond it, and it is what leaving out says."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import least_squares

from consistency import build_hall, compute_error
from knowledge_sources.methods.pose import PlanarEstimate, Rests, compute_protection, planar_from_lines
from knowledge_sources.methods.pose.solution_separation import LEFT, RIGHT
from world_models.camera import Camera, CameraMount
from world_models.entries import ALERT_LIMIT_M, Hypothesis, Protection, count_sigmas, diagonal
from world_models.frames import Pose2

CAMERA, MOUNT = Camera.from_field_of_view(np.radians(65.0)), CameraMount(1.0, 0.1)
SIGMA_PX = 0.3
BELIEF_SIGMA = np.array([0.02, 0.02, 0.005])
LOOSENED = 4.0 * np.diag(BELIEF_SIGMA**2) + np.diag([0.05**2, 0.05**2, math.radians(1.5) ** 2])
KNOWN = np.diag(np.array([3e-4, 3e-4, 3e-4, 0.0015, 0.001, 0.2, 0.2]) ** 2)
HALL = build_hall()
NAMES = ["south wall", "south wall", "north wall", "north wall",
         *(f"door {i // 3}" for i in range(len(HALL) - 4))]
Array = NDArray[np.float64]
seeds = st.integers(0, 2**32 - 1)
quick = settings(max_examples=25, deadline=None)


def look(seed: int, *, shift: Array | None = None, belief: Any = (0.0, 0.0, 0.0), sigma_px: float = SIGMA_PX,
         hall: Array = HALL, turn: Pose2 | None = None) -> tuple[PlanarEstimate, Rests, Pose2]:
    """A picture from near the origin: the pose found, what it rests on, and where the robot truly stands.

    Args:
        shift: (n, 3) by how much the true lines are elsewhere than in the model [m]. belief: its error, (3,).
        turn: the whole scene is moved by it.
    """
    rng = np.random.default_rng(seed)
    frame = turn or Pose2(0.0, 0.0, 0.0)
    truth = frame @ Pose2(*rng.normal(0.0, [0.3, 0.2, 0.05]))
    moved = place(hall, frame)
    true_lines = moved if shift is None else place(hall + shift[:, None], frame)
    there = MOUNT.camera_from_robot @ truth.lifted().inverse()
    shown = np.flatnonzero(CAMERA.project_segments(moved, there)[1] & CAMERA.project_segments(true_lines, there)[1])
    segments = CAMERA.project_segments(true_lines[shown], there)[0]
    segments = segments + rng.normal(0.0, sigma_px, segments.shape)
    turned = np.array(frame.lifted().rotation)[:2, :2] @ np.asarray(belief, float)[:2]
    here = Pose2(truth.x_m + turned[0], truth.y_m + turned[1], truth.heading_rad + belief[2])
    names = [NAMES[i] for i in shown]
    found = planar_from_lines(moved[shown], segments, CAMERA, MOUNT.camera_from_robot, here,
                              prior_covariance=LOOSENED, landmark_ids=names, sigma_px=0.7)
    near = found.inliers
    rests = Rests(moved[shown][near], segments[near], [n for n, kept in zip(names, near, strict=True) if kept],
                  CAMERA, MOUNT, np.zeros(7), here, np.diag(BELIEF_SIGMA**2), LOOSENED, KNOWN)
    return found, rests, truth


def place(lines: Array, frame: Pose2) -> Array:
    return np.asarray(frame.lifted().apply(lines.reshape(-1, 3)).reshape(lines.shape))


def protect(found: PlanarEstimate, rests: Rests) -> Protection:
    return compute_protection(found.world_from_robot, found.covariance, rests)


def is_within(found: PlanarEstimate, truth: Pose2, level: Protection) -> bool:
    x_m, y_m, heading = compute_error(found.world_from_robot, truth)
    return math.hypot(x_m, y_m) <= level.place_m and abs(heading) <= level.heading_rad


@quick
@given(seeds)
def test_without_a_lie_the_error_is_within_it_and_it_does_not_doubt_all(seed: int) -> None:
    found, rests, truth = look(seed, belief=np.random.default_rng([seed, 1]).normal(0.0, BELIEF_SIGMA))
    level = protect(found, rests)
    assert is_within(found, truth, level) and level.place_m <= 1.5 * ALERT_LIMIT_M


@quick
@given(seeds, st.sampled_from(sorted(set(NAMES))), st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))
def test_no_landmark_that_stands_elsewhere_moves_the_pose_beyond_it(
    seed: int, name: str, x_m: float, y_m: float
) -> None:
    shift = np.array([[x_m, y_m, 0.0] if of == name else [0.0, 0.0, 0.0] for of in NAMES])
    found, rests, truth = look(seed, shift=shift)
    error = compute_error(found.world_from_robot, truth)
    event(f"the pose is moved by {'more' if math.hypot(*error[:2]) > 0.02 else 'less'} than 2 cm")
    assert is_within(found, truth, protect(found, rests))


@quick
@given(seeds, st.sampled_from((-1.0, 1.0)), st.floats(-0.15, 0.15))
def test_no_side_of_a_corridor_that_stands_elsewhere_moves_the_pose_beyond_it(
    seed: int, side: float, wider_m: float
) -> None:
    """A wall, with all doors in it."""
    shift = np.array([[0.0, wider_m if np.sign(line[0, 1]) == side else 0.0, 0.0] for line in HALL])
    found, rests, truth = look(seed, shift=shift)
    assert is_within(found, truth, protect(found, rests))


@quick
@given(seeds, st.floats(-0.15, 0.15))
def test_no_wall_ahead_that_stands_elsewhere_moves_the_pose_beyond_it(seed: int, by_m: float) -> None:
    """With all that is on it, on both sides; and the belief came of the same wall, within its own protection level."""
    ahead = HALL[HALL[:, 0, 1] > 0.0][..., [1, 0, 2]] * (1.0, -1.0, 1.0) + (2.5, 7.5, 0.0)
    elsewhere = np.tile([by_m, 0.0, 0.0], (len(ahead), 1))
    found, rests, truth = look(seed, hall=ahead, shift=elsewhere, belief=(-by_m, 0.0, 0.0))
    normal = np.tile([1.0, 0.0, 0.0], (len(rests.lines_world), 1))
    held = rests._replace(walls=[("wall", normal)], covariance=rests.covariance / 16.0, excess=(abs(by_m), 0.0))
    assert is_within(found, truth, protect(found, held))


@quick
@given(seeds, st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))
def test_no_belief_that_was_pushed_or_told_wrongly_moves_the_pose_beyond_it(seed: int, x_m: float, y_m: float) -> None:
    """Put down as told it was not pushed, so that what is near or far leaves no more open; were it told wrongly."""
    found, rests, truth = look(seed, belief=(x_m, y_m, 0.0))
    pushed, put_down = protect(found, rests), protect(found, rests._replace(loosened=None))
    assert is_within(found, truth, pushed) and is_within(found, truth, put_down)
    right, sure, _ = look(seed)
    assert protect(right, sure._replace(loosened=None)).place_m <= protect(right, sure).place_m


@quick
@given(seeds, st.integers(0, 5))
def test_it_is_no_smaller_than_a_landmark_left_out_says(seed: int, which: int) -> None:
    """The pose without it, by scipy and not linear, is within; and so is what its own covariance leaves open."""
    shift = np.array([[0.0, 0.1, 0.0] if name == "door 1" else [0.0, 0.0, 0.0] for name in NAMES])
    found, rests, _ = look(seed, shift=shift)
    names = np.array(rests.landmarks)
    name = sorted(set(rests.landmarks))[which % len(set(rests.landmarks))]
    rest = names != name
    here = rests.belief.vector
    weigh = np.linalg.inv(np.linalg.cholesky(4.0 * rests.covariance))
    sigma_px = max(0.2, float(np.sqrt(np.mean(found.residuals_px[found.inliers] ** 2))))

    def compute_residuals(state: Array) -> Array:
        pose = Pose2(*state)
        seen, _ = CAMERA.project_segments(
            rests.lines_world[rest], MOUNT.camera_from_robot @ pose.lifted().inverse())
        along = seen[:, 1] - seen[:, 0]
        normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
        off = np.einsum("nd,ned->ne", normal, rests.segments_px[rest] - seen[:, :1])
        return np.concatenate([off.ravel() / sigma_px, weigh @ (state - here)])

    alone = least_squares(compute_residuals, found.world_from_robot.vector).x
    away_m = math.hypot(*(alone - found.world_from_robot.vector)[:2])
    assert protect(found, rests).place_m >= 0.9 * away_m


@quick
@given(seeds)
def test_a_mirrored_scene_has_the_mirrored_level(seed: int) -> None:
    found, rests, _ = look(seed)
    sides = np.array([1.0, -1.0, 1.0])
    pose = found.world_from_robot
    flip = np.diag([1.0, -1.0, -1.0])
    mirrored = rests._replace(
        lines_world=rests.lines_world * sides,
        segments_px=np.stack([2.0 * CAMERA.cx - rests.segments_px[..., 0], rests.segments_px[..., 1]], axis=-1),
        belief=Pose2(rests.belief.x_m, -rests.belief.y_m, -rests.belief.heading_rad))
    ours = protect(found, rests)
    other = compute_protection(Pose2(pose.x_m, -pose.y_m, -pose.heading_rad), flip @ found.covariance @ flip, mirrored)
    assert other.place_m == pytest.approx(ours.place_m) and other.heading_rad == pytest.approx(ours.heading_rad)
    assert other.doubted == {LEFT: RIGHT, RIGHT: LEFT}.get(ours.doubted, ours.doubted)


@quick
@given(seeds, st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(-3.0, 3.0))
def test_a_moved_and_turned_scene_has_the_same_level(seed: int, x_m: float, y_m: float, turn: float) -> None:
    plain, moved = (protect(*look(seed, turn=frame)[:2]) for frame in (None, Pose2(x_m, y_m, turn)))
    assert moved.place_m == pytest.approx(plain.place_m, rel=1e-3)
    assert moved.heading_rad == pytest.approx(plain.heading_rad, rel=1e-3) and moved.doubted == plain.doubted


@quick
@given(seeds)
def test_lines_that_scatter_more_than_usual_doubt_the_pose(seed: int) -> None:
    quiet, loud = (protect(*look(seed, sigma_px=sigma_px)[:2]) for sigma_px in (0.2, 0.8))
    assert loud.place_m > quiet.place_m


def test_a_pose_by_one_wall_alone_is_no_surer_than_the_belief() -> None:
    found, rests, _ = look(1)
    south = np.array([name == "south wall" for name in rests.landmarks])
    alone = rests._replace(lines_world=rests.lines_world[south], segments_px=rests.segments_px[south],
                           landmarks=["south wall"] * int(south.sum()))
    level = protect(found, alone)
    assert level.place_m >= count_sigmas(1) * 2.0 * BELIEF_SIGMA[0]
    assert protect(found, rests).place_m < level.place_m


def test_a_belief_without_any_doubt_is_a_belief_too() -> None:
    """Put down exactly: what is seen is held against that, and nothing is infinite."""
    found, rests, _ = look(1)
    sure = protect(found, rests._replace(covariance=np.zeros((3, 3))))
    assert math.isfinite(sure.place_m) and math.isfinite(sure.heading_rad)
    assert sure.place_m >= protect(found, rests._replace(covariance=1e-6 * np.eye(3))).place_m * 0.9


def test_nothing_seen_leaves_what_is_stated() -> None:
    found, rests, _ = look(1)
    none = rests._replace(lines_world=np.zeros((0, 2, 3)), segments_px=np.zeros((0, 2, 2)), landmarks=[])
    level = compute_protection(found.world_from_robot, np.diag(BELIEF_SIGMA**2), none)
    assert level.place_m == pytest.approx(count_sigmas(1) * math.hypot(BELIEF_SIGMA[0], 0.0077))


@given(st.floats(0.0, 1.0), st.floats(0.001, 0.2))
def test_a_belief_keeps_what_its_fix_may_be_off_by_and_adds_what_the_wheels_leave_open(
    place_m: float, sigma_m: float
) -> None:
    """Never below what its own covariance says."""
    belief = Hypothesis("hall", Pose2(0.0, 0.0, 0.0), diagonal(sigma_m, 0.01), "milestone")
    kept = belief.protected(Protection(place_m, 0.1, "a wall"))
    assert kept.protection_m == pytest.approx(max(place_m, belief.protection_m))
    assert kept.protected(Protection(place_m, 0.1, "a wall")) == kept
