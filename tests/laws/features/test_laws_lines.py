"""Laws of the line finder on edges whose place is known exactly."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from knowledge_sources.methods.arrays import Floats, Image
from knowledge_sources.methods.features import LineSegments, find_lines, lines

SIZE = 81
angles = st.floats(0.0, 2.0 * np.pi)
phases = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
few = settings(deadline=None, max_examples=25)


def coverage(point: Any, normal: Any, size: int = SIZE) -> Floats:
    """Share of each pixel's square on the normal's side of a line, in closed form."""
    v, u = np.mgrid[0:size, 0:size].astype(float)
    distance = (u - point[0]) * normal[0] + (v - point[1]) * normal[1]
    p, q = np.maximum(np.abs(normal), 1e-4)

    def ramp(x: Floats) -> Floats:
        return np.maximum(x, 0.0) ** 2 / 2.0

    a, b = (p + q) / 2.0, (p - q) / 2.0
    share = (ramp(distance + a) - ramp(distance + b) - ramp(distance - b) + ramp(distance - a)) / (p * q)
    return np.asarray(np.clip(share, 0.0, 1.0))


def step(angle: float, phase: Any, dark: float = 60.0, bright: float = 180.0) -> tuple[Any, Any, Any]:
    """An image with one edge through the middle, a point on it and the unit normal towards the bright side."""
    normal = np.array([np.cos(angle), np.sin(angle)])
    point = np.array([SIZE // 2, SIZE // 2]) + phase
    return dark + (bright - dark) * coverage(point, normal), point, normal


def grey(image: Floats) -> Image:
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def prediction(point: Any, normal: Any, offset: float = 0.0, turn: float = 0.0) -> Floats:
    along = np.array([-normal[1], normal[0]]) + turn * normal
    centre = point + offset * normal
    return np.array([[centre - 28.0 * along, centre + 28.0 * along]])


def longest(found: LineSegments) -> int:
    return int(np.argmax(found.lengths_px))


def off_line(found: LineSegments, point: Any, normal: Any) -> Floats:
    return np.asarray((found.segments_px[longest(found)] - point) @ normal)


@few
@given(angles, phases, st.floats(30.0, 200.0))
def test_a_clean_edge_is_found_to_a_twentieth_of_a_pixel(angle: float, phase: Any, contrast: float) -> None:
    image, point, normal = step(angle, phase, 20.0, 20.0 + contrast)
    for predicted in (None, prediction(point, normal, 4.0, 0.05)):
        found = find_lines(grey(image), predicted)
        assert found.lengths_px.max() > 40.0
        assert np.abs(off_line(found, point, normal)).max() < 0.05
        assert abs(found.contrast[longest(found)]) == pytest.approx(contrast, rel=0.15)


@few
@given(angles, phases)
def test_the_brighter_side_is_on_the_right(angle: float, phase: tuple[float, float]) -> None:
    image, _, normal = step(angle, phase)
    found = find_lines(grey(image))
    start, end = found.segments_px[longest(found)]
    right = np.array([-(end - start)[1], (end - start)[0]])
    assert right @ normal > 0.0
    assert np.all(found.contrast > 0.0)


@few
@given(angles, phases, st.integers(-9, 9), st.integers(-9, 9))
@example(angle=1.03125, phase=(0.0, 0.0), du=-1, dv=0)  # the shift alone made the band longer by a rounding
def test_a_shifted_image_has_shifted_lines(angle: float, phase: tuple[float, float], du: int, dv: int) -> None:
    image, point, normal = step(angle, phase)
    shifted, _, _ = step(angle, (phase[0] + du, phase[1] + dv))
    predicted = prediction(point, normal)
    predicted = point + 0.5 * (predicted - point)  # clear of the border in both
    shift = np.array([du, dv])
    a = find_lines(grey(image), predicted, band_px=5.0)
    b = find_lines(grey(shifted), predicted + shift, band_px=5.0)
    np.testing.assert_allclose(off_line(b, point + shift, normal), off_line(a, point, normal), atol=0.02)
    np.testing.assert_allclose(b.segments_px, a.segments_px + shift, atol=2.0)


@few
@given(angles, phases)
def test_a_flipped_image_has_flipped_lines(angle: float, phase: tuple[float, float]) -> None:
    image, point, normal = step(angle, phase)
    flipped = grey(image)[:, ::-1]
    mirrored_point, mirrored_normal = (SIZE - 1 - point[0], point[1]), normal * (-1.0, 1.0)
    for predicted in (None, prediction(point, normal, 3.0) * (-1.0, 1.0) + (SIZE - 1.0, 0.0)):
        found = find_lines(flipped, predicted)
        assert np.abs(off_line(found, mirrored_point, mirrored_normal)).max() < 0.05


@few
@given(angles, phases)
def test_the_negative_has_the_same_lines_with_the_other_sign(angle: float, phase: tuple[float, float]) -> None:
    image, point, normal = step(angle, phase)
    predicted = prediction(point, normal, -3.0)
    a, b = find_lines(image, predicted), find_lines(240.0 - image, predicted)
    np.testing.assert_allclose(a.segments_px, b.segments_px, atol=0.02)
    np.testing.assert_allclose(a.contrast, -b.contrast, rtol=0.02)


@few
@given(angles, phases)
def test_turning_a_prediction_round_turns_the_segment_and_the_sign(angle: float, phase: tuple[float, float]) -> None:
    image, point, normal = step(angle, phase)
    predicted = prediction(point, normal, 2.0)
    a, b = find_lines(grey(image), predicted), find_lines(grey(image), predicted[:, ::-1])
    np.testing.assert_allclose(off_line(a, point, normal), off_line(b, point, normal)[::-1], atol=0.02)
    assert a.contrast[longest(a)] * b.contrast[longest(b)] < 0.0


@few
@given(st.permutations(range(4)))
def test_predictions_are_independent_of_their_order(order: list[int]) -> None:
    image, boxes = rectangle(0.3, (17.0, 12.0))
    one, other = find_lines(image, boxes), find_lines(image, boxes[order])
    for new, old in enumerate(order):
        np.testing.assert_allclose(
            other.take(other.predicted == new).segments_px, one.take(one.predicted == old).segments_px, atol=1e-3
        )


def rectangle(angle: float, half: tuple[float, float]) -> tuple[Image, Floats]:
    """A bright rectangle, and its four sides."""
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    middle = np.array([SIZE / 2.0, SIZE / 2.0])
    share = np.ones((SIZE, SIZE))
    for axis, extent in zip(axes, half, strict=True):
        for sign in (-1.0, 1.0):
            share = np.minimum(share, coverage(middle + sign * extent * axis, -sign * axis))
    corners = middle + np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half @ axes
    return grey(50.0 + 120.0 * share), np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


@few
@given(angles, st.tuples(st.floats(12.0, 25.0), st.floats(12.0, 25.0)), st.floats(-4.0, 4.0))
def test_bands_find_what_the_whole_image_finds(angle: float, half: tuple[float, float], offset: float) -> None:
    image, sides = rectangle(angle, half)
    whole = find_lines(image, min_length_px=14.0)
    whole = whole.take(np.argsort(-whole.lengths_px)[:4])
    near = find_lines(image, whole.segments_px + offset, min_length_px=10.0)
    for k, segment in enumerate(whole.segments_px):
        mine = near.take(near.predicted == k)
        distance = [np.abs(line_distance(segment, other.mean(axis=0))).max() for other in mine.segments_px]
        assert min(distance) < 0.1
    assert len(sides) == len(whole)


def line_distance(segment: Floats, point: Floats) -> float:
    along = (segment[1] - segment[0]) / np.linalg.norm(segment[1] - segment[0])
    return float((point - segment[0]) @ (-along[1], along[0]))


@pytest.mark.parametrize(("noise", "contrast", "quality"), [(4.0, 60.0, None), (2.0, 30.0, 90), (6.0, 40.0, None)])
def test_the_standard_deviations_are_true(
    noise: float, contrast: float, quality: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lines, "LINE_SYSTEMATIC_PX", 0.005)
    rng = np.random.default_rng(7)
    offsets, turns = [], []
    for _ in range(80):
        image, point, normal = step(rng.uniform(0, 2 * np.pi), rng.uniform(-0.5, 0.5, 2), 100.0, 100.0 + contrast)
        seen = grey(image + noise * rng.standard_normal(image.shape))
        if quality is not None:
            coded = cv2.imencode(".jpg", seen, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
            seen = np.asarray(cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE), np.uint8)
        predicted = prediction(point, normal, rng.uniform(-5, 5), rng.uniform(-0.08, 0.08))
        found = find_lines(seen, predicted)
        k = longest(found)
        error = off_line(found, point, normal)
        offsets.append(error.mean() / found.sigma_offset_px[k])
        turns.append((error[1] - error[0]) / found.lengths_px[k] / found.sigma_angle_rad[k])
    for normalised in (offsets, turns):
        assert 0.5 < np.sqrt(np.mean(np.square(normalised))) < 1.3
    assert abs(np.mean(offsets)) < 0.4  # unbiased


@few
@given(st.integers(0, 10_000), st.floats(0.5, 12.0))
def test_noise_alone_has_hardly_any_lines(seed: int, noise: float) -> None:
    rng = np.random.default_rng(seed)
    image = grey(120.0 + noise * rng.standard_normal((SIZE, SIZE)))
    predicted = rng.uniform(10.0, SIZE - 10.0, (10, 2, 2))
    assert len(find_lines(image, predicted, min_length_px=12.0)) <= 1
