"""The focused line finder on real photographs: the lines of a surveyed model are found where they are."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from knowledge_sources.methods.features import find_lines
from world_models.camera import Camera
from world_models.frames import Pose

DATA = Path(__file__).parents[2].parent / "shared" / "data" / "corridor"

pytestmark = pytest.mark.skipif(
    not (DATA / "corridor.json").is_file(), reason="the corridor photographs are not beside the repository"
)


def frames() -> list[tuple[NDArray[np.uint8], NDArray[np.float64]]]:
    """Each photograph with its visible model lines of 5 px and more, (n, 2, 2) [px]."""
    data = json.loads((DATA / "corridor.json").read_text())
    return [(photograph(f["image"]), visible(np.array(data["model_lines"]), f)) for f in data["frames"]]


def photograph(name: str) -> NDArray[np.uint8]:
    return np.asarray(cv2.imread(str(DATA / name), cv2.IMREAD_GRAYSCALE), np.uint8)


def visible(lines: NDArray[np.float64], frame: dict[str, Any]) -> NDArray[np.float64]:
    pose = Pose(np.array(frame["camera_from_world"]["rotation"]), np.array(frame["camera_from_world"]["translation"]))
    camera = Camera(*(frame[k] for k in ("fx", "fy", "cx", "cy", "width", "height")))
    projected, seen = camera.project_segments(lines, pose)
    kept = projected[seen]
    return np.asarray(kept[np.linalg.norm(kept[:, 1] - kept[:, 0], axis=1) > 5.0])


def covered_share(model: NDArray[np.float64], segments: NDArray[np.float64], within_px: float = 1.5) -> float:
    """Share of the model lines' length that has a segment within a distance and 0.12 rad of it."""
    length = covered = 0.0
    for start, end in model:
        size = float(np.linalg.norm(end - start))
        mask = covered_places(start, (end - start) / size, size, segments, within_px)
        length, covered = length + size, covered + size * float(mask.mean())
    return covered / length


def covered_places(
    start: NDArray[np.float64], along: NDArray[np.float64], size: float, segments: NDArray[np.float64], within: float
) -> NDArray[np.bool_]:
    t, o = (segments - start) @ along, (segments - start) @ np.array([-along[1], along[0]])
    mask = np.zeros(int(np.ceil(size)) + 1, bool)
    for (t0, t1), (o0, o1) in zip(t, o, strict=True):
        low, high = max(min(t0, t1), 0.0), min(max(t0, t1), size)
        if high > low and abs(o1 - o0) < 0.12 * abs(t1 - t0):
            offset = o0 + (o1 - o0) * ((low + high) / 2.0 - t0) / (t1 - t0)
            if abs(offset) < within:
                mask[round(low) : round(high) + 1] = True
    return mask


def test_ninety_five_per_cent_of_the_model_is_found_and_not_by_chance() -> None:
    near, beside = [], []
    for image, model in frames():
        found = find_lines(image, model)
        normal = (model[:, 1] - model[:, 0])[:, ::-1] * (-1.0, 1.0)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        near.append(covered_share(model, found.segments_px))
        beside.append(covered_share(model + 8.0 * normal[:, None], found.segments_px))
    assert np.mean(near) >= 0.95
    assert np.mean(beside) < 0.5 * np.mean(near)


def test_the_whole_image_finder_covers_most_of_it_too() -> None:
    shares = [covered_share(model, find_lines(image).segments_px) for image, model in frames()]
    assert np.mean(shares) >= 0.85


def test_found_lines_are_as_true_as_the_survey() -> None:
    """Distance of the model's lines from what was found: median below a third of a pixel."""
    offsets = []
    for image, model in frames():
        found = find_lines(image, model, band_px=3.0, min_length_px=20.0)
        owner = model[found.predicted]
        along = (owner[:, 1] - owner[:, 0]) / np.linalg.norm(owner[:, 1] - owner[:, 0], axis=1, keepdims=True)
        middle = found.segments_px.mean(axis=1) - owner[:, 0]
        offsets += np.abs(along[:, 0] * middle[:, 1] - along[:, 1] * middle[:, 0]).tolist()
    assert np.median(offsets) < 0.35
