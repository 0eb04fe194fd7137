"""Mirror law and frame law of matching, of footprints, of place odds and of doors (see test_laws_mirror.py)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from generated_boards import mirrored, to_world
from harvey.testing import HALL, HOUSE, plain_robot
from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.doors import predict_opening
from knowledge_sources.methods.floor import build_free_floor, list_corners
from knowledge_sources.methods.floor.footprints import (
    deepen,
    join_footprints,
    measure_common_directions,
    measure_free_part,
    take_free,
)
from knowledge_sources.methods.localization.place_odds import compute_place_odds, is_within_reach
from knowledge_sources.methods.matching import match_lines, match_on_floor
from knowledge_sources.methods.verification import predict_lines
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world
from world_models.frames import Pose2, flattened, wrap_angle

ROBOT = plain_robot()
SIGNS = np.array([1.0, -1.0, -1.0])
COVARIANCE = np.diag([0.06, 0.04, 0.02]) ** 2
metres = st.floats(-3.0, 3.0)
frames = st.builds(Pose2, metres, metres, st.floats(-3.0, 3.0))


def turn_of(frame: Pose2) -> Floats:
    c, s = math.cos(frame.heading_rad), math.sin(frame.heading_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def flip(pose: Pose2) -> Pose2:
    """Mirrored about the world's x axis."""
    return Pose2(pose.x_m, -pose.y_m, -pose.heading_rad)


def flip_px(segments_px: Floats) -> Floats:
    """In the mirrored picture."""
    return np.stack([2.0 * ROBOT.camera.cx - segments_px[..., 0], segments_px[..., 1]], axis=-1)


def look(seed: int) -> tuple[Pose2, Pose2, Floats, Floats]:
    """The believed pose, the true one, model lines, and segments: some of these, noisy, with lines of other things."""
    rng = np.random.default_rng(seed)
    belief = to_world(Pose2(rng.uniform(1.5, 4.0), rng.uniform(1.2, 2.8), rng.uniform(-0.5, 0.5)))
    truth = belief @ Pose2(*rng.normal(0.0, (0.05, 0.04, 0.015)))
    lines = predict_lines(ROBOT, belief).lines_world
    seen = ROBOT.camera.project_segments(lines, ROBOT.camera_from_world(truth))[0]
    seen = seen[np.isfinite(seen).all(axis=(1, 2))]
    kept = seen[rng.random(len(seen)) < 0.85]
    other = rng.uniform(20.0, 230.0, (6, 1, 2)) + rng.uniform(-25.0, 25.0, (6, 2, 2))
    return belief, truth, lines, np.concatenate([kept + rng.normal(0.0, 0.3, kept.shape), other])


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("frame", [Pose2(-7.0, 3.0, 2.0), Pose2(0.5, 40.0, -1.1)])
def test_lines_are_matched_on_the_floor_as_in_a_mirror_and_as_elsewhere(seed: int, frame: Pose2) -> None:
    belief, truth, lines, seen = look(seed)
    given_ = ROBOT.camera, ROBOT.mount.camera_from_robot
    plain = match_on_floor(lines, seen, *given_, belief, COVARIANCE)
    other = match_on_floor(lines * (1.0, -1.0, 1.0), flip_px(seen), *given_, flip(belief),
                           COVARIANCE * np.outer(SIGNS, SIGNS))
    turn = turn_of(frame)
    there = match_on_floor(frame.lifted().apply(lines.reshape(-1, 3)).reshape(-1, 2, 3), seen, *given_,
                           frame @ belief, turn @ COVARIANCE @ turn.T)
    pairs = set(map(tuple, np.asarray(plain.pairs).tolist()))
    assert len(pairs) > 8 and plain.world_from_robot.distance_to(truth) < 0.05
    for found, wanted in ((other, flip(plain.world_from_robot)), (there, frame @ plain.world_from_robot)):
        assert set(map(tuple, np.asarray(found.pairs).tolist())) == pairs
        assert found.world_from_robot.distance_to(wanted) < 1e-3
        assert wrap_angle(found.world_from_robot.heading_rad - wanted.heading_rad) == pytest.approx(0.0, abs=1e-3)
        assert found.e_match == pytest.approx(plain.e_match, rel=1e-3)


@pytest.mark.parametrize("seed", range(6))
def test_lines_are_matched_in_the_picture_as_in_a_mirror(seed: int) -> None:
    belief, _, lines, seen = look(seed)
    model = ROBOT.camera.project_segments(lines, ROBOT.camera_from_world(belief))[0]
    model = model[np.isfinite(model).all(axis=(1, 2))]
    plain, other = match_lines(model, seen), match_lines(flip_px(model), flip_px(seen))
    assert len(plain.pairs) > 8
    assert set(map(tuple, np.asarray(other.pairs).tolist())) == set(map(tuple, np.asarray(plain.pairs).tolist()))
    assert other.e_match == pytest.approx(plain.e_match, rel=1e-3)


shapes = st.builds(
    lambda at, long_m, wide_m: at.apply(np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.3, 1.0)]) * (long_m, wide_m)),
    st.builds(Pose2, st.floats(1.0, 2.5), st.floats(-0.8, 0.8), st.floats(-3.0, 3.0)), st.floats(0.2, 1.0),
    st.floats(0.1, 0.8))
"""Four corners of something before the eye."""


@settings(max_examples=60, deadline=None)
@given(shapes, shapes, frames, st.floats(0.05, 1.0))
def test_footprints_are_joined_and_taken_back_as_in_a_mirror_and_as_elsewhere(
    known: Floats, seen: Floats, frame: Pose2, depth_m: float
) -> None:
    bearings, near, far = np.linspace(-0.6, 0.6, 13), np.full(13, 0.4), np.linspace(1.2, 2.6, 13)

    def measure(put: Any, eye: Pose2, sign: float) -> list[float]:
        """All that is measured, where ``put`` moves points and ``eye`` is where the sight is from."""
        moved = [put(shape) for shape in (known, seen)]
        order = slice(None, None, int(sign))
        free = build_free_floor(eye.x_m, eye.y_m, (eye.heading_rad + sign * bearings)[order].tolist(), near.tolist(),
                                far[order].tolist())
        one, other = (deepen(shape, eye.position, depth_m) for shape in moved)
        joined, left = join_footprints(one, other, free), take_free(one, free)
        corners = list_corners(joined)
        return [free.area, one.area, joined.area, left.area, measure_free_part(one, free),
                measure_common_directions(one, other, eye.position), shapely.Polygon(corners).area if corners else 0.0]

    plain = measure(lambda p: p, Pose2(0.0, 0.0, 0.0), 1.0)
    assert measure(lambda p: p * (1.0, -1.0), Pose2(0.0, 0.0, 0.0), -1.0) == pytest.approx(plain, abs=2e-2)
    assert measure(frame.apply, frame, 1.0) == pytest.approx(plain, abs=2e-2)


@settings(max_examples=60)
@given(st.lists(st.tuples(st.floats(-9.0, 9.0), st.booleans(), st.booleans()), min_size=2, max_size=6), st.randoms(),
       st.floats(0.05, 0.98))
def test_the_odds_of_places_do_not_depend_on_their_order(
    places: list[tuple[float, bool, bool]], random: Any, p_told: float
) -> None:
    order = list(range(len(places)))
    random.shuffle(order)
    plain = compute_place_odds(*zip(*places, strict=True), p_told)
    shuffled = compute_place_odds(*zip(*(places[k] for k in order), strict=True), p_told)
    assert shuffled == pytest.approx([plain[k] for k in order])


@settings(max_examples=60)
@given(st.builds(Pose2, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-0.6, 0.6)), frames)
def test_a_place_is_within_reach_as_in_a_mirror_and_as_elsewhere(off: Pose2, frame: Pose2) -> None:
    told, turn = Pose2(0.3, -0.2, 0.1), turn_of(frame)
    wide = np.array([[0.04, 0.015, 0.0], [0.015, 0.02, 0.002], [0.0, 0.002, 0.01]])
    plain = is_within_reach(told @ off, COVARIANCE, told, wide)
    assert is_within_reach(flip(told @ off), COVARIANCE, flip(told), wide * np.outer(SIGNS, SIGNS)) == plain
    assert is_within_reach(frame @ told @ off, turn @ COVARIANCE @ turn.T, frame @ told, turn @ wide @ turn.T) == plain


@pytest.mark.parametrize("pose", [Pose2(5.0, 1.4, 0.1), Pose2(4.2, 2.9, -0.3), Pose2(6.6, 2.0, 0.2)])
def test_an_opening_is_seen_as_in_a_mirror_and_as_elsewhere(pose: Pose2) -> None:
    """The door is in the middle of the wall; its samples are a grid, whose seam may fall a sample aside."""
    def see(at: Pose2, turn_deg: float = 0.0) -> Any:
        text = HOUSE.replace("at = [3, -2]\nturn = 30", f"at = [-8, 5]\nturn = {turn_deg}") if turn_deg else HOUSE
        one = plain_robot(read_world(Source.parse(text, "house.toml")))
        (door,) = one.world.doorways_of(HALL)
        world_from_hall = flattened(one.world.world_from_locale(HALL))
        found = predict_opening(one, world_from_hall @ at, COVARIANCE * 0.01, door, HALL, one.world)
        assert found is not None
        return found

    plain, there, other = see(pose), see(pose, 117.0), see(mirrored(pose))
    left, top, right, bottom = plain.box_px
    assert there.box_px == pytest.approx((left, top, right, bottom), abs=1e-6)
    middle = 2.0 * ROBOT.camera.cx
    assert other.box_px == pytest.approx((middle - right, top, middle - left, bottom), abs=1e-6)
    for found in (there, other):
        assert found.sine == pytest.approx(plain.sine) and found.distance_m == pytest.approx(plain.distance_m)
        assert abs(len(found.pixels) - len(plain.pixels)) <= 0.05 * len(plain.pixels)
    mean = float(np.mean(plain.across))
    assert np.mean(there.across) == pytest.approx(mean, abs=0.01)
    assert np.mean(other.across) == pytest.approx(1.0 - mean, abs=0.01)
