"""Laws of the line finder on edges whose place is known exactly, and of its deviations: they are true.

Of what it says is known to a sigma, so much lies within one and within two.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from knowledge_sources.methods.arrays import Floats, Image
from knowledge_sources.methods.features import LineSegments, find_lines, lines

SIZE = 81
SIGMA_END_PX = 0.7
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
    picture, boxes = rectangle(0.3, (17.0, 12.0))
    image = grey(picture)
    one, other = find_lines(image, boxes), find_lines(image, boxes[order])
    for new, old in enumerate(order):
        np.testing.assert_allclose(
            other.take(other.predicted == new).segments_px, one.take(one.predicted == old).segments_px, atol=1e-3
        )


def rectangle(angle: float, half: tuple[float, float]) -> tuple[Floats, Floats]:
    """A bright rectangle, and its four sides (4, 2, 2)."""
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    middle = np.array([SIZE / 2.0, SIZE / 2.0])
    share = np.ones((SIZE, SIZE))
    for axis, extent in zip(axes, half, strict=True):
        for sign in (-1.0, 1.0):
            share = np.minimum(share, coverage(middle + sign * extent * axis, -sign * axis))
    corners = middle + np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half @ axes
    return 50.0 + 120.0 * share, np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


@few
@given(angles, st.tuples(st.floats(12.0, 25.0), st.floats(12.0, 25.0)), st.floats(-4.0, 4.0))
def test_bands_find_what_the_whole_image_finds(angle: float, half: tuple[float, float], offset: float) -> None:
    picture, sides = rectangle(angle, half)
    image = grey(picture)
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


@few
@given(st.integers(0, 10_000), st.floats(0.5, 12.0))
def test_noise_alone_has_hardly_any_lines(seed: int, noise: float) -> None:
    rng = np.random.default_rng(seed)
    image = grey(120.0 + noise * rng.standard_normal((SIZE, SIZE)))
    for predicted in (None, rng.uniform(10.0, SIZE - 10.0, (10, 2, 2))):
        assert len(find_lines(image, predicted, min_length_px=12.0)) <= 1


def seen(image: Floats, noise: float, quality: int | None, rng: np.random.Generator) -> Image:
    """An image through a blurring lens and a noisy sensor, coded as a camera does where a quality is given."""
    blurred = cv2.GaussianBlur(image, (0, 0), 0.5)
    picture = grey(blurred + noise * rng.standard_normal(image.shape))
    if quality is None:
        return picture
    coded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    return np.asarray(cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE), np.uint8)


def predictions(ends: Floats, rng: np.random.Generator) -> Floats:
    """The lines (n, 2, 2) as a prior that is a few pixels and degrees off would have them."""
    turn = rng.uniform(-0.06, 0.06)
    middle = ends.mean(axis=(0, 1))
    rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    return np.asarray((ends - middle) @ rotation + middle + rng.uniform(-3.0, 3.0, 2))


def off_and_turn(found: LineSegments, point: Floats, normal: Floats) -> tuple[float, float]:
    """Errors of the longest segment's middle and direction, in its own deviations."""
    k = int(np.argmax(found.lengths_px))
    off = (found.segments_px[k] - point) @ normal
    turn = (off[1] - off[0]) / found.lengths_px[k]
    return float(off.mean() / found.sigma_offset_px[k]), float(turn / found.sigma_angle_rad[k])


@pytest.mark.parametrize(("noise", "contrast", "quality"), [(4.0, 60.0, None), (2.0, 30.0, 90), (6.0, 40.0, None)])
@pytest.mark.parametrize("focused", [False, True])
def test_two_thirds_lie_within_one_deviation_and_nearly_all_within_two(
    noise: float, contrast: float, quality: int | None, focused: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lines, "LINE_SYSTEMATIC_PX", 0.005)
    rng = np.random.default_rng(11)
    errors = []
    for _ in range(100):
        angle = rng.uniform(0.0, 2.0 * np.pi)
        normal, point = np.array([np.cos(angle), np.sin(angle)]), SIZE // 2 + rng.uniform(-0.5, 0.5, 2)
        picture = seen(100.0 + contrast * coverage(point, normal), noise, quality, rng)
        along = 28.0 * np.array([-normal[1], normal[0]])
        near = predictions(np.array([[point - along, point + along]]), rng) if focused else None
        errors.append(off_and_turn(find_lines(picture, near), point, normal))
    sizes = np.abs(errors)
    assert np.all(np.abs(np.mean(errors, axis=0)) < 0.35)  # unbiased
    assert np.all((np.mean(sizes < 1.0, axis=0) > 0.5) & (np.mean(sizes < 1.0, axis=0) < 0.88))
    assert np.all(np.mean(sizes < 2.0, axis=0) > 0.88)


def end_errors(found: LineSegments, side: Floats) -> list[float]:
    """How far the ends of the longest segment on a side lie inside it [px]; negative: beyond."""
    length = float(np.linalg.norm(side[1] - side[0]))
    along = (side[1] - side[0]) / length
    places, offs = (found.segments_px - side[0]) @ along, (found.segments_px - side[0]) @ (-along[1], along[0])
    on = np.all(np.abs(offs) < 1.0, axis=1)
    low, high = np.sort(places[on], axis=1)[int(np.argmax(found.lengths_px[on]))]
    return [low, length - high]


@pytest.mark.parametrize("focused", [False, True])
def test_ends_lie_where_their_deviation_says(focused: bool) -> None:
    rng = np.random.default_rng(3)
    errors = []
    for _ in range(40):
        image, sides = rectangle(rng.uniform(0.0, 2.0 * np.pi), tuple(rng.uniform(12.0, 25.0, 2)))
        found = find_lines(seen(image, 1.5, None, rng), sides if focused else None)
        errors += [error for side in sides for error in end_errors(found, side)]
    assert abs(np.mean(errors)) < 0.5 * SIGMA_END_PX
    assert np.mean(np.abs(errors) < SIGMA_END_PX) > 0.6
    assert np.mean(np.abs(errors) < 2.0 * SIGMA_END_PX) > 0.93


@few
@given(st.floats(0.0, np.pi), st.floats(5.0, 9.0))
def test_two_steps_of_one_sign_side_by_side_stay_two(angle: float, apart: float) -> None:
    normal = np.array([np.cos(angle), np.sin(angle)])
    first = np.array([SIZE / 2.0, SIZE / 2.0])
    image = 60.0 + 60.0 * coverage(first, normal) + 60.0 * coverage(first + apart * normal, normal)
    found = find_lines(grey(image), min_length_px=30.0)
    off = np.sort((found.segments_px.mean(axis=1) - first) @ normal)
    np.testing.assert_allclose(off, [0.0, apart], atol=0.1)


@few
@given(st.floats(0.35, 1.2), st.floats(0.0, 2.0 * np.pi))
def test_an_edge_that_bends_becomes_two_that_do_not(bend: float, angle: float) -> None:
    """The bright side is a wedge of pi - bend: each of its sides is found, and no chord across the corner."""
    corner = np.array([SIZE / 2.0, SIZE / 2.0])
    normals = [np.array([np.cos(a), np.sin(a)]) for a in (angle - bend / 2.0, angle + bend / 2.0)]
    wedge = np.minimum(coverage(corner, normals[0]), coverage(corner, normals[1]))
    found = find_lines(grey(60.0 + 100.0 * wedge), min_length_px=20.0)
    assert len(found) == 2
    for normal in normals:
        worst = np.abs((found.segments_px - corner) @ normal).max(axis=1)
        assert worst.min() < 0.3
