"""Laws of the line finder: the lines of a picture and its light, of the milestone that waits for it."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from blackboard import Entry
from generated_boards import Bench, effect_on, reasons
from harvey.testing import check_source, plain_robot
from knowledge_sources.methods.features import find_lines, read_picture
from knowledge_sources.milestone.line_finder import MIN_SEGMENT_LENGTH_PX, LineFinder
from world_models.entries import CameraPicture, Segments
from world_models.entries.task import MilestoneStatus

SOURCE = LineFinder()


def take(bench: Bench, image: np.ndarray, purpose: str = "milestone") -> Entry[CameraPicture]:
    jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()
    return bench.put(CameraPicture(jpeg, 0, 1.0, purpose))


def draw(*, edge: float = 100.0, low: int = 60, high: int = 180) -> np.ndarray:
    """Dark on the left, bright on the right of a column."""
    image = np.full((256, 256, 3), low, np.uint8)
    image[:, int(edge):] = high
    return image


@pytest.mark.parametrize("edge", [60.0, 100.0, 180.0])
def test_an_edge_is_one_line_where_it_is_and_the_light_is_mean_and_deviation(edge: float) -> None:
    bench = Bench(plain_robot())
    milestone = bench.await_milestone(status="expected")
    frame = take(bench, draw(edge=edge))
    effect = effect_on(bench.ask(SOURCE, frame), Segments)
    seen = effect.value
    assert (seen.frame, seen.milestone) == (frame.id, milestone.id) and reasons(effect) == {frame.id, milestone.id}
    lengths = np.linalg.norm(seen.segments_px[:, 1] - seen.segments_px[:, 0], axis=1)
    assert len(lengths) == len(seen.sigma_px) >= 1 and lengths.min() >= MIN_SEGMENT_LENGTH_PX
    longest = seen.segments_px[lengths.argmax()]
    assert np.allclose(longest[:, 0], edge - 0.5, atol=0.3) and lengths.max() > 220.0
    bright = (256.0 - edge) / 256.0
    mean = 60.0 + 120.0 * bright
    assert seen.brightness == pytest.approx(mean, abs=1.5)
    assert seen.contrast == pytest.approx(120.0 * np.sqrt(bright * (1.0 - bright)), abs=1.5)


def test_the_flipped_picture_has_the_flipped_lines() -> None:
    found = []
    for image in (draw(), np.ascontiguousarray(draw()[:, ::-1])):
        bench = Bench(plain_robot())
        segments = effect_on(bench.ask(SOURCE, take(bench, image)), Segments).value.segments_px
        found.append(segments[np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).argmax()])
    one, other = found
    assert one[:, 0].mean() == pytest.approx(255.0 - other[:, 0].mean(), abs=0.2)


@pytest.mark.parametrize("k1", [-0.25, 0.1])
@pytest.mark.parametrize("edge", [50.0, 200.0])
def test_what_the_lens_bends_is_straight_again_where_a_pinhole_sees_it(k1: float, edge: float) -> None:
    robot = plain_robot()
    lens = replace(robot.camera, distortion=(k1, 0.0, 0.0, 0.0, 0.0))
    rows, columns = np.mgrid[0:256, 0:256]
    straight = lens.pinhole.project(lens.rays(np.stack([columns, rows], axis=-1)))[..., 0]
    image = np.repeat(np.where(straight < edge - 0.5, 60, 180).astype(np.uint8)[..., None], 3, axis=2)
    bench = Bench(robot)
    bench.revise(bench.view["CameraState-1"], lens=lens)
    segments = effect_on(bench.ask(SOURCE, take(bench, image)), Segments).value.segments_px
    lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    near = np.abs(segments[..., 0] - (edge - 0.5)).max(axis=1) < 1.5
    assert lengths[near].sum() > 150.0  # a pinhole of the same focal length sees at least so much of it


def test_how_sure_each_line_is_goes_with_it() -> None:
    """As the finder of lines says it: a bright edge is surer than a faint one."""
    image = draw(edge=80.0, low=60, high=110)
    image[:, 170:] = 250
    bench = Bench(plain_robot())
    frame = take(bench, image)
    seen = effect_on(bench.ask(SOURCE, frame), Segments).value
    found = find_lines(read_picture(frame.value.jpeg).rectified(plain_robot().lens, plain_robot().camera),
                       min_length_px=MIN_SEGMENT_LENGTH_PX)
    assert np.array_equal(seen.segments_px, found.segments_px) and np.array_equal(seen.sigma_px, found.sigma_offset_px)
    faint, bright = (seen.sigma_px[np.abs(seen.segments_px[..., 0].mean(axis=1) - at).argmin()] for at in (80.0, 170.0))
    assert bright < faint


def test_a_blank_picture_has_no_lines_and_no_contrast() -> None:
    bench = Bench(plain_robot())
    seen = effect_on(bench.ask(SOURCE, take(bench, draw(low=128, high=128))), Segments).value
    assert seen.segments_px.shape == (0, 2, 2) and seen.contrast < 1.0
    assert seen.brightness == pytest.approx(128.0, abs=1.0)


@pytest.mark.parametrize("purpose", ["milestone", "probe"])
@pytest.mark.parametrize("status", ["expected", "verified"])
def test_only_a_picture_for_milestones_is_of_the_one_that_is_awaited(purpose: str, status: MilestoneStatus) -> None:
    bench = Bench(plain_robot())
    milestone = bench.await_milestone(status=status)
    frame = take(bench, draw(), purpose)
    effect = effect_on(bench.ask(SOURCE, frame), Segments)
    is_its = (purpose, status) == ("milestone", "expected")
    assert effect.value.milestone == (milestone.id if is_its else "")
    assert reasons(effect) == ({frame.id, milestone.id} if is_its else {frame.id})


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench(plain_robot())
    bench.await_milestone(status="expected")
    check_source(SOURCE, bench, take(bench, draw()))
