"""The camera file: it holds the same numbers, and how well they are known; what is wrong in it is pointed at."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from world_models.camera import Camera, CameraDeviation, CameraMount
from world_models.files.toml.camera_file import CameraFileError, camera_text, load_camera

CAMERA = Camera(402.0, 405.0, 250.3, 259.1, 512, 512, (-0.2, 0.05, 0.001, -0.0005))


def test_a_camera_file_holds_the_same_numbers(tmp_path: Path) -> None:
    mount = CameraMount(0.2, 0.08, math.radians(5.0))
    (tmp_path / "camera.toml").write_text(camera_text(CAMERA, mount, ("a note",)))
    camera, read, _ = load_camera(tmp_path / "camera.toml")
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy)
    np.testing.assert_array_equal(camera.distortion, CAMERA.distortion)
    assert read is not None and read.height_m == 0.2 and read.tilt_rad == pytest.approx(mount.tilt_rad)
    (tmp_path / "camera.toml").write_text(camera_text(Camera(1.0, 2.0, 3.0, 4.0, 50, 60), None))
    assert load_camera(tmp_path / "camera.toml")[1] is None


def test_a_camera_file_says_how_well_it_is_known(tmp_path: Path) -> None:
    deviation = CameraDeviation(math.radians(0.2), 0.003, 0.0, 0.001)
    text = camera_text(CAMERA, CameraMount(0.2), deviation=deviation)
    (tmp_path / "camera.toml").write_text(text)
    read = load_camera(tmp_path / "camera.toml").deviation
    assert dataclasses.astuple(read) == pytest.approx(dataclasses.astuple(deviation))
    assert "forward_m" not in text.partition("[deviation]")[2]
    (tmp_path / "camera.toml").write_text(camera_text(CAMERA, CameraMount(0.2), deviation=CameraDeviation()))
    assert "deviation" not in (tmp_path / "camera.toml").read_text()
    assert load_camera(tmp_path / "camera.toml").deviation == CameraDeviation()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("fx_px = 402.0", "fx_px = -1"), r"camera.toml:4: camera.fx_px: expected a number from 1 to 1e\+06, got -1"),
        (("width_px = 512", "width_px = 51.5"), "expected a whole number of pixels"),
        (("[camera]", "[kamera]"), "expected the key 'camera'"),
        (("fx_px", "fz_px"), "expected the key 'fx_px'"),
        (("distortion = [", "distortion = [0.0, 0.0, "), "expected an array of 4 or 5 numbers"),
        (("height_m = 0.2", "height_m = 'tall'"), "height_m: expected a number"),
        (("[mount]", "[deviation]\nheight_m = -1.0\n[mount]"), "deviation.height_m: expected a number from 0 to 1"),
        (("[mount]", "[deviation]\nlean_deg = 1.0\n[mount]"), "lean_deg"),
    ],
)
def test_a_camera_file_that_is_wrong_is_pointed_at(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    text = camera_text(CAMERA, CameraMount(0.2))
    assert change[0] in text
    path = tmp_path / "camera.toml"
    path.write_text(text.replace(*change, 1))
    with pytest.raises(CameraFileError, match=message):
        load_camera(path)
