"""What is drawn over the picture stays within the picture, and goes when the next picture comes."""

from pathlib import Path

import numpy as np
import pytest

from journals import logged
from logs.recording.loggers.picture_overlays import LABEL_PX
from logs.recording.paths import DRIFTS, EXPECTED, IMAGE, LANDMARK_NAMES, MATCHED, SEGMENTS, WINDOWS
from logs.recording.writer import RecordingWriter
from scripted_mission import CAMERA, MOUNT, house, play

LAST_PX = CAMERA.width - 0.5


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("overlays") / "recording.rrd"
    recorder = RecordingWriter(path, world=house(), camera=CAMERA, mount=MOUNT, title="house", recording_id="house")
    play([recorder])
    recorder.close()
    return path


@pytest.mark.parametrize("entity", [EXPECTED, SEGMENTS, MATCHED, f"{IMAGE}/rejected"])
def test_lines_are_clipped_to_the_picture(recording: Path, entity: str) -> None:
    rows = logged(recording, entity, "LineStrips2D:strips")
    assert rows
    points = np.array([line for _, lines in rows for line in lines]).reshape(-1, 2)
    assert len(points) and points.min() >= -0.5 and points.max() <= LAST_PX


def test_what_lies_outside_is_left_out(recording: Path) -> None:
    assert len(logged(recording, SEGMENTS, "LineStrips2D:strips")[0][1]) == 2


def test_templates_are_cut_at_the_border_and_left_out_beyond(recording: Path) -> None:
    centres = np.array(logged(recording, WINDOWS, "Boxes2D:centers")[-1][1])
    halves = np.array(logged(recording, WINDOWS, "Boxes2D:half_sizes")[-1][1])
    assert len(centres) == 2
    assert (centres - halves).min() >= 0.0 and (centres + halves).max() <= LAST_PX


def test_a_drift_is_drawn_longer(recording: Path) -> None:
    assert np.allclose(logged(recording, DRIFTS, "Arrows2D:vectors")[-1][1], [[20.0, 10.0]], atol=1e-4)


def test_names_of_landmarks_stay_inside_and_apart(recording: Path) -> None:
    spots = np.array(logged(recording, LANDMARK_NAMES, "Points2D:positions")[0][1])
    names = logged(recording, LANDMARK_NAMES, "Points2D:labels")[0][1]
    assert names == ["kitchen-door"] and len(spots) == 1
    assert LABEL_PX <= spots[0, 0] <= CAMERA.width - LABEL_PX


def test_the_next_picture_takes_the_old_lines_away(recording: Path) -> None:
    frames = [cycle for cycle, _ in logged(recording, IMAGE, "EncodedImage:blob")]
    for entity in (SEGMENTS, MATCHED, EXPECTED):
        drawn = logged(recording, entity, "LineStrips2D:strips")
        wiped = [cycle for cycle, lines in drawn if not lines]
        assert frames[0] <= drawn[0][0] or entity == EXPECTED
        assert wiped == [frames[1]]
