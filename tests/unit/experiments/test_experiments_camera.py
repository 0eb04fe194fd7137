"""The experiments of the camera: small versions hold what they claim."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from experiments.perception import lens
from experiments.robustness import video_stream
from harvey.hardware.drivers.camera import VideoCamera
from world_models.entries.body import BodyFault, Frame, MotionReport, MotorCommand

JPEG = cv2.imencode(".jpg", np.full((48, 64, 3), 90, np.uint8))[1].tobytes()


def test_lines_are_best_found_in_the_straightened_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lens, "QUICK_CARDS", 3)
    monkeypatch.setattr(lens, "LENSES", tuple(k for k in lens.LENSES if k[0] in ("none", "k1 = -0.2")))
    report = lens.run(True, 0)
    assert report.holds, report.text()
    assert len(report.rows) == 3


def test_a_repeating_body_answers_with_what_was_recorded(tmp_path: Path) -> None:
    (tmp_path / "one.mjpeg").write_bytes(JPEG)
    done = MotionReport(0.1, 0.6, 2.0, 2.0)
    with VideoCamera(str(tmp_path / "one.mjpeg"), None, clock=lambda: 0.0) as camera:
        body = video_stream.RepeatingBody([done], camera)
        assert body.execute(MotorCommand(0.1, 0.5)) == done
        ended = body.execute(MotorCommand(0.0, 0.5))
        assert isinstance(ended, BodyFault) and "end here" in ended.detail
        frame = body.look("track")
        assert isinstance(frame, Frame) and frame.jpeg == JPEG
        over = body.look("track")
        assert isinstance(over, BodyFault) and (over.part, over.what) == ("camera", "unplugged")

