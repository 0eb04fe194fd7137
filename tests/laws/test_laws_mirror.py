"""Mirror law and frame law of methods: left and right are alike, and no place or direction of the world is special.

Mirrored, y and headings have the other sign, and pictures are flipped. Turned and shifted, all poses of the world are.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from generated_boards import Bench, effect_on, mirrored, to_world
from harvey.testing import plain_robot
from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.doors import MAX_LOG_ODDS, MIN_LOG_RATIO, update_door
from knowledge_sources.methods.pose import planar_from_points
from knowledge_sources.methods.tracking.edge_alignment import _Edges, _solve
from knowledge_sources.methods.verification import predict_color_check
from knowledge_sources.milestone_selector.view_predictor import ViewPredictor
from world_models.entries import DoorPicture, DoorState, Milestone
from world_models.frames import Pose2, wrap_angle

SIGNS = np.array([1.0, -1.0, -1.0])
"""What a mirrored pose (x, y, heading) is multiplied with."""
ROBOT = plain_robot()
SMALL = 1e-9
metres = st.floats(-6.0, 6.0)
free_poses = st.builds(Pose2, metres, metres, st.floats(-3.0, 3.0))


def flip(pose: Pose2) -> Pose2:
    """Mirrored about the world's x axis."""
    return Pose2(pose.x_m, -pose.y_m, -pose.heading_rad)


def as_numbers(pose: Pose2) -> Floats:
    return np.array([pose.x_m, pose.y_m, pose.heading_rad])


def is_same(one: Pose2, other: Pose2, within: float = 1e-9) -> bool:
    turn = wrap_angle(one.heading_rad - other.heading_rad)
    return math.hypot(one.x_m - other.x_m, one.y_m - other.y_m) < within and abs(turn) < within


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(-3.0, 3.0), st.sampled_from((0.5, 1.0, 3.0)), free_poses)
def test_a_pose_by_points(seed: int, heading: float, sigma_px: float, frame: Pose2) -> None:
    """Mirrored, and in another frame; what is left over is in pixels, whatever their standard deviation."""
    rng = np.random.default_rng(seed)
    truth = Pose2(1.0, -2.0, heading)
    points = truth.lifted().apply(rng.uniform((3.0, -1.2, 0.0), (9.0, 1.2, 2.2), (24, 3)))
    camera = ROBOT.camera
    pixels = camera.project(ROBOT.camera_from_world(truth).apply(points)) + rng.normal(0.0, sigma_px, (24, 2))
    prior = Pose2(truth.x_m + 0.05, truth.y_m - 0.04, heading + 0.01)
    covariance = np.diag([0.05, 0.08, 0.02]) ** 2

    def solve(world: Floats, seen: Floats, start: Pose2, spread: Floats) -> tuple[Pose2, Floats, Floats]:
        found = planar_from_points(world, seen, camera, ROBOT.mount.camera_from_robot, start, spread,
                                   sigma_px=sigma_px)
        return found.world_from_robot, found.covariance, found.residuals_px

    pose, spread, residuals = solve(points, pixels, prior, covariance)
    again = camera.project(ROBOT.camera_from_world(pose).apply(points))
    assert np.allclose(np.abs(residuals), np.abs(again - pixels), atol=1e-6)
    flipped = np.stack([2.0 * camera.cx - pixels[:, 0], pixels[:, 1]], axis=1)
    mirrored_pose, mirrored_spread, _ = solve(points * (1.0, -1.0, 1.0), flipped, flip(prior), covariance)
    assert is_same(mirrored_pose, flip(pose), 1e-4)
    assert np.allclose(mirrored_spread, spread * np.outer(SIGNS, SIGNS), rtol=1e-2, atol=1e-7)
    c, s = math.cos(frame.heading_rad), math.sin(frame.heading_rad)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    there, _, _ = solve(frame.lifted().apply(points), pixels, frame @ prior, turn @ covariance @ turn.T)
    assert is_same(there, frame @ pose, 1e-4)


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.tuples(*[st.floats(-0.02, 0.02)] * 3))
def test_where_edges_are_linearised_does_not_matter(seed: int, step: tuple[float, float, float]) -> None:
    """The belief is one more measurement, in every pass the same: it draws back to where it is."""
    rng = np.random.default_rng(seed)
    slopes, line = rng.normal(0.0, 5.0, (80, 3)), np.repeat(np.arange(16), 5)
    prior, covariance = Pose2(1.0, 2.0, 0.3), np.diag([0.01, 0.02, 0.005]) ** 2
    offsets = slopes @ rng.normal(0.0, 0.005, 3) + rng.normal(0.0, 0.2, 80)
    at = Pose2(*(as_numbers(prior) + step))
    one = _solve(_Edges(offsets, slopes, line), prior, prior, covariance)
    other = _solve(_Edges(offsets - slopes @ np.array(step), slopes, line), at, prior, covariance)
    assert one is not None and other is not None
    assert is_same(one.world_from_robot, other.world_from_robot, 1e-6)


@settings(max_examples=40)
@given(st.floats(-6.0, 6.0), st.floats(MIN_LOG_RATIO, 4.0), st.sampled_from((1.0, -1.0)))
def test_what_was_believed_of_a_door_by_pictures_that_are_not_kept_stays(
    odds: float, ratio: float, sign: float
) -> None:
    """A picture from elsewhere is added to it; one from the same place counts once."""
    last = DoorPicture("CameraPicture-0", (0.0, 0.0, 9.0, 9.0), 1.0, 2.0, 0.3, sign * MIN_LOG_RATIO, "")
    known = DoorState("door", ("a", "b"), "unknown", 0.5, odds, 2, last, 1.0)
    new = DoorPicture("CameraPicture-1", (0.0, 0.0, 9.0, 9.0), 5.0, 2.0, 0.3, sign * ratio, "")
    again = update_door(known, "door", ("a", "b"), new, 2.0, is_believed_shut=False)
    wanted = min(max(odds + sign * ratio, -MAX_LOG_ODDS), MAX_LOG_ODDS)
    assert again is None or again.log_odds == pytest.approx(wanted)
    assert again is not None or wanted == pytest.approx(odds)


colours = st.tuples(*[st.floats(0.05, 1.0)] * 3)


@settings(max_examples=60)
@given(st.lists(colours, min_size=3, max_size=6))
def test_chance_is_what_agrees_with_the_colours_of_other_faces(faces: list[tuple[float, float, float]]) -> None:
    """Redone one face at a time: colours given to the wrong faces, all round, and never to the right ones."""
    logs = [np.log(255.0 * np.array(colour) + 4.0) for colour in faces]
    n = len(logs)
    shares = []
    for shift in range(1, n):
        ratios = [logs[k] - logs[(k - shift) % n] for k in range(n)]
        counts = []
        for one in ratios:
            offs = [one - other for other in ratios]
            counts.append(sum(abs(off.mean()) <= 0.3 and np.abs(off - off.mean()).max() <= 0.1 for off in offs))
        shares.append(max(counts) / n)
    check = predict_color_check([(colour, ()) for colour in faces])
    assert check.chance == pytest.approx(float(np.mean(shares)), abs=1e-9)
    assert (check.count, check.agreeing) == (n, 1.0) and check.is_testable == (check.chance <= 0.8)


@pytest.mark.parametrize("pose", [Pose2(2.0, 1.5, 0.3), Pose2(4.0, 1.0, -1.2), Pose2(5.0, 2.4, 2.5),
                                  Pose2(6.0, 3.0, -3.0)])
def test_what_is_expected_to_be_seen(pose: Pose2) -> None:
    """Where lines end at others is found by samples along them, so a few ends lie some pixels off."""
    pictures = []
    for here in (pose, mirrored(pose)):
        bench = Bench(ROBOT)
        bench.believe(here)
        milestone = bench.await_milestone(look_heading_rad=to_world(here).heading_rad)
        expected = effect_on(bench.ask(ViewPredictor(), milestone), Milestone).value.expected_px
        pictures.append(np.array(expected).reshape(-1, 2, 2))
    one, other = pictures
    flipped = np.stack([2.0 * ROBOT.camera.cx - other[..., 0], other[..., 1]], axis=-1)
    apart = np.array([min(min(np.abs(line - f).max(), np.abs(line[::-1] - f).max()) for f in flipped) for line in one])
    assert abs(len(one) - len(other)) <= 1 and np.median(apart) < 0.2 and apart.max() < 4.0
