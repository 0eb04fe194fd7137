"""Regions and decoding: limits and errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from knowledge_sources.methods.arrays import Image
from knowledge_sources.methods.features import read_picture, segment_regions
from knowledge_sources.methods.features.picture import Picture, estimate_noise_sigma
from world_models.camera import Camera


def test_a_plain_image_is_one_region() -> None:
    assert not segment_regions(np.full((100, 130), 77, np.uint8)).any()


def test_an_image_smaller_than_a_sector_is_segmented() -> None:
    image = np.full((20, 20), 30, np.uint8)
    image[:, 10:] = 200
    assert segment_regions(image).max() == 1


def test_regions_need_sensible_limits() -> None:
    with pytest.raises(ValueError, match="expected sector_px >= 8"):
        segment_regions(np.zeros((20, 20)), sector_px=2)


@pytest.mark.parametrize("data", [b"", b"no picture", b"\xff\xd8\xff\xe0 cut off", "text", None, 7])
@pytest.mark.parametrize("view", ["grey", "half", "quarter", "color"])
def test_bytes_that_are_no_picture_are_refused(data: Any, view: str) -> None:
    with pytest.raises(ValueError, match="expected the bytes of a"):
        getattr(read_picture(data), view)


def test_a_picture_survives_its_compression() -> None:
    image = np.zeros((30, 40, 3), np.uint8)
    image[:, 20:] = (250, 10, 10)  # OpenCV's order: blue first
    data = cv2.imencode(".png", image)[1].tobytes()
    assert read_picture(data).grey.shape == (30, 40)
    np.testing.assert_array_equal(read_picture(data).color[5, 30], [10, 10, 250])


def test_a_picture_is_decoded_once_a_view() -> None:
    data = cv2.imencode(".jpg", np.random.default_rng(1).integers(0, 256, (32, 40, 3)).astype(np.uint8))[1].tobytes()
    plain = Camera(40.0, 40.0, 20.0, 16.0, 40, 32)
    bent = replace(plain, distortion=(-0.1, 0.0, 0.0, 0.0))
    views: tuple[Callable[[Picture], Image], ...] = (
        lambda p: p.grey, lambda p: p.half, lambda p: p.quarter,
        lambda p: p.rectified(bent, plain), lambda p: p.rectified_half(bent, plain))
    shapes = ((32, 40), (16, 20, 3), (8, 10, 3), (32, 40), (16, 20, 3))
    for view, shape in zip(views, shapes, strict=True):
        image = view(read_picture(data))
        assert image.shape == shape and image is view(read_picture(bytes(bytearray(data))))
        with pytest.raises(ValueError, match="read-only"):
            image[0] = 0
    assert read_picture(data).rectified(plain, plain) is read_picture(data).grey
    assert read_picture(data).rectified_half(plain, plain) is read_picture(data).half


@pytest.mark.parametrize("noise", [1.0, 3.0, 8.0])
def test_the_noise_is_estimated_beside_edges(noise: float) -> None:
    rng = np.random.default_rng(2)
    image = np.where(np.arange(200) % 40 < 20, 60.0, 160.0) + noise * rng.standard_normal((200, 200))
    assert estimate_noise_sigma(image.astype(np.float32)) == pytest.approx(noise, rel=0.15)
