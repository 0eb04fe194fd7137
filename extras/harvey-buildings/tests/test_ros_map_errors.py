"""ROS maps that cannot be read: one sentence that names the file and what was expected, exit code 2."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from harvey.cli import main

GOOD = {"image": "m.pgm", "resolution": "0.05", "origin": "[0, 0, 0]", "negate": "0", "occupied_thresh": "0.65",
        "free_thresh": "0.196"}
FRAME = np.pad(np.full((60, 80), 254, np.uint8), 4, constant_values=0)


def write(folder: Path, picture: bytes | None = None, drop: str = "", name: str = "m.pgm", **changed: str) -> Path:
    lines = {**GOOD, "image": name, **changed}
    (folder / "m.yaml").write_text("".join(f"{k}: {v}\n" for k, v in lines.items() if k != drop))
    if picture is not None:
        (folder / name).write_bytes(picture)
    return folder / "m.yaml"


def pgm(picture: np.ndarray) -> bytes:
    return f"P5 {picture.shape[1]} {picture.shape[0]} 255\n".encode() + picture.tobytes()


def png(picture: np.ndarray) -> bytes:
    return cv2.imencode(".png", picture)[1].tobytes()


def said(capsys: pytest.CaptureFixture[str], *argv: str) -> tuple[int, str]:
    try:
        code = main(["world", "import", *argv])
    except SystemExit as stop:
        code = int(stop.code or 0)
    return code, capsys.readouterr().err


@pytest.mark.parametrize(("changed", "names"), [
    ({"drop": "image"}, "m.yaml: expected a line 'image"),
    ({"drop": "resolution"}, "m.yaml: expected a line 'resolution"),
    ({"drop": "origin"}, "m.yaml: expected a line 'origin"),
    ({"resolution": "0"}, "m.yaml:2: expected a resolution"),
    ({"resolution": "nan"}, "m.yaml:2: expected a finite number"),
    ({"resolution": "five"}, "m.yaml:2: expected a number for resolution"),
    ({"origin": "[0, 0]"}, "m.yaml:3: expected origin: [x, y, yaw]"),
    ({"negate": "maybe"}, "m.yaml:4: expected negate 0 or 1"),
    ({"free_thresh": "0.9"}, "expected free_thresh below occupied_thresh"),
    ({"occupied_thresh": "65"}, "m.yaml:5: expected occupied_thresh from 0 to 1"),
    ({"mode": "colour"}, "expected mode trinary, scale, raw"),
    ({"picture": None}, "m.pgm: expected the picture that the map.yaml names"),
    ({"picture": b""}, "m.pgm: expected a picture as PGM"),
    ({"picture": pgm(FRAME)[:-9]}, "m.pgm: expected 88 x 68 cells"),
    ({"picture": b"P2 3 2 255\n1 2 x 4 5 6"}, "m.pgm: expected a plain PGM of numbers"),
    ({"picture": b"P5 0 2 255\n"}, "m.pgm: expected 1 to"),
    ({"picture": b"P5 3"}, "m.pgm: expected the width, height"),
    ({"picture": b"GIF89a and so on, for a while more"}, "m.pgm: expected a picture as PGM"),
    ({"name": "m.png", "picture": png(FRAME)[:-40]}, "m.png: expected a whole PNG"),
    ({"name": "m.png", "picture": png(FRAME)[:40] + b"\0" * 60 + png(FRAME)[100:]}, "m.png: expected a picture"),
    ({"picture": pgm(np.full((40, 40), 205, np.uint8))}, "m.pgm: expected free and occupied cells, got no free one"),
    ({"picture": pgm(np.full((40, 40), 254, np.uint8))}, "got no occupied one"),
    ({"picture": pgm(np.pad(np.full((4, 4), 254, np.uint8), 2))}, "m.pgm: expected a room of 1.5 m2"),
])
def test_a_map_that_cannot_be_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], changed: dict[str, str | bytes | None], names: str,
) -> None:
    path = write(tmp_path, **{"picture": pgm(FRAME), **changed})  # type: ignore[arg-type]
    code, text = said(capsys, str(path), "--out", str(tmp_path / "m.toml"))
    assert code == 2
    assert names in text
    assert "Traceback" not in text


def test_a_picture_alone_is_told_how_to_write_its_map_yaml(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, pgm(FRAME))
    code, text = said(capsys, str(tmp_path / "m.pgm"))
    assert code == 2
    assert "Write m.yaml beside it" in text and "resolution: 0.05" in text


@pytest.mark.parametrize("height", ["0.2", "300", "nan"])
def test_a_wall_height_out_of_range(tmp_path: Path, capsys: pytest.CaptureFixture[str], height: str) -> None:
    code, text = said(capsys, str(write(tmp_path, pgm(FRAME))), "--out", str(tmp_path / "m.toml"),
                      "--wall-height", height)
    assert code == 2
    assert "--wall-height: expected" in text


def test_walls_have_the_height_that_is_asked_for(tmp_path: Path) -> None:
    assert main(["world", "import", str(write(tmp_path, pgm(FRAME))), "--out", str(tmp_path / "m.toml"),
                 "--wall-height", "3.25"]) == 0
    assert "height = 3.25" in (tmp_path / "m.toml").read_text()
