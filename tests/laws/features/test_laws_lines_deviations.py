"""The line finder's deviations are true: of what it says is known to a sigma, so much lies within one and within two.

Edges and corners are drawn in closed form, seen through a blurring lens and a noisy sensor, and coded as a camera does.
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
LOOKS = [(4.0, 60.0, None), (2.0, 30.0, 90), (6.0, 40.0, None)]


def share_beyond(point: Any, normal: Any) -> Floats:
    """Share of each pixel's square on the normal's side of a line, to an eighth of a pixel."""
    fine = (np.arange(8 * SIZE) + 0.5) / 8.0 - 0.5
    side = (fine[None, :] - point[0]) * normal[0] + (fine[:, None] - point[1]) * normal[1]
    return np.asarray(np.clip(8.0 * side + 0.5, 0.0, 1.0).reshape(SIZE, 8, SIZE, 8).mean(axis=(1, 3)))


def seen(image: Floats, noise: float, quality: int | None, rng: np.random.Generator) -> Image:
    blurred = cv2.GaussianBlur(image, (0, 0), 0.5)
    grey = np.clip(np.rint(blurred + noise * rng.standard_normal(image.shape)), 0, 255).astype(np.uint8)
    if quality is None:
        return grey
    coded = cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
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


@pytest.mark.parametrize(("noise", "contrast", "quality"), LOOKS)
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
        picture = seen(100.0 + contrast * share_beyond(point, normal), noise, quality, rng)
        along = 28.0 * np.array([-normal[1], normal[0]])
        near = predictions(np.array([[point - along, point + along]]), rng) if focused else None
        errors.append(off_and_turn(find_lines(picture, near), point, normal))
    sizes = np.abs(errors)
    assert np.all(np.abs(np.mean(errors, axis=0)) < 0.35)  # unbiased
    assert np.all((np.mean(sizes < 1.0, axis=0) > 0.5) & (np.mean(sizes < 1.0, axis=0) < 0.88))
    assert np.all(np.mean(sizes < 2.0, axis=0) > 0.88)


def rectangle(rng: np.random.Generator) -> tuple[Floats, Floats]:
    """A bright rectangle on grey, and its sides (4, 2, 2)."""
    angle, half = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(12.0, 25.0, 2)
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    middle, share = np.array([SIZE / 2.0, SIZE / 2.0]), np.ones((SIZE, SIZE))
    for axis, extent in zip(axes, half, strict=True):
        for sign in (-1.0, 1.0):
            share = np.minimum(share, share_beyond(middle + sign * extent * axis, -sign * axis))
    corners = middle + np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half @ axes
    return 50.0 + 120.0 * share, np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


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
        image, sides = rectangle(rng)
        found = find_lines(seen(image, 1.5, None, rng), sides if focused else None)
        errors += [error for side in sides for error in end_errors(found, side)]
    assert abs(np.mean(errors)) < 0.5 * SIGMA_END_PX
    assert np.mean(np.abs(errors) < SIGMA_END_PX) > 0.6
    assert np.mean(np.abs(errors) < 2.0 * SIGMA_END_PX) > 0.93


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 10_000), st.floats(0.5, 12.0))
def test_noise_alone_has_hardly_any_lines_in_the_whole_image(seed: int, noise: float) -> None:
    rng = np.random.default_rng(seed)
    image = np.clip(np.rint(120.0 + noise * rng.standard_normal((SIZE, SIZE))), 0, 255).astype(np.uint8)
    assert len(find_lines(image, min_length_px=12.0)) <= 1


@settings(deadline=None, max_examples=15)
@given(st.floats(0.0, np.pi), st.floats(5.0, 9.0))
def test_two_steps_of_one_sign_side_by_side_stay_two(angle: float, apart: float) -> None:
    normal = np.array([np.cos(angle), np.sin(angle)])
    first = np.array([SIZE / 2.0, SIZE / 2.0])
    image = 60.0 + 60.0 * share_beyond(first, normal) + 60.0 * share_beyond(first + apart * normal, normal)
    found = find_lines(np.rint(image).astype(np.uint8), min_length_px=30.0)
    off = np.sort((found.segments_px.mean(axis=1) - first) @ normal)
    np.testing.assert_allclose(off, [0.0, apart], atol=0.1)


@settings(deadline=None, max_examples=15)
@given(st.floats(0.35, 1.2), st.floats(0.0, 2.0 * np.pi))
def test_an_edge_that_bends_becomes_two_that_do_not(bend: float, angle: float) -> None:
    """The bright side is a wedge of pi - bend: each of its sides is found, and no chord across the corner."""
    corner = np.array([SIZE / 2.0, SIZE / 2.0])
    normals = [np.array([np.cos(a), np.sin(a)]) for a in (angle - bend / 2.0, angle + bend / 2.0)]
    wedge = np.minimum(share_beyond(corner, normals[0]), share_beyond(corner, normals[1]))
    found = find_lines(np.rint(60.0 + 100.0 * wedge).astype(np.uint8), min_length_px=20.0)
    assert len(found) == 2
    for normal in normals:
        worst = np.abs((found.segments_px - corner) @ normal).max(axis=1)
        assert worst.min() < 0.3
