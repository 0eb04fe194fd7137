"""Calibration: rendered boards give their camera back, within its standard deviations; unusable pictures say why."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from harvey.cli import main
from harvey.errors import BadInput
from harvey_survey.board_pictures import Boards, calibrate_camera, find_boards, save_board
from harvey_survey.calibrate_experiment import CAMERA, PATTERN, board_picture, board_renderer, board_view
from harvey_survey.intrinsics import BoardView, Calibration, calibrate, estimate_mounting, find_board
from knowledge_sources.methods.features import read_picture
from sim.render.optics import Optics
from sim.render.sensor import SensorParameters
from world_models.camera import CameraDeviation, CameraMount
from world_models.files.toml.camera_file import load_camera
from world_models.frames import Pose

TRUE = np.array([402.0, 405.0, 250.3, 259.1, -0.2, 0.05, 0.001, -0.0005])
VIEWS = 10


@pytest.fixture(scope="module")
def pictures() -> list[bytes]:
    renderer, optics, rng = board_renderer(PATTERN), Optics.of(CAMERA), np.random.default_rng(2)
    poses = [board_view(CAMERA, PATTERN, rng) for _ in range(VIEWS)]
    return [board_picture(renderer, optics, pose, SensorParameters(), rng) for pose in poses]


def seen(picture: bytes, name: str = "") -> BoardView:
    found = find_board(name, read_picture(picture).grey, PATTERN)
    assert isinstance(found, BoardView)
    return found


@pytest.fixture(scope="module")
def views(pictures: list[bytes]) -> list[BoardView]:
    return [seen(picture, str(number)) for number, picture in enumerate(pictures)]


@pytest.fixture(scope="module")
def calibration(views: list[BoardView]) -> Calibration:
    return calibrate(views, PATTERN, (512, 512))


def test_the_camera_comes_back_within_four_deviations(calibration: Calibration) -> None:
    assert np.all(np.abs(calibration.values - TRUE) < 4.0 * calibration.deviations)
    assert np.all(calibration.deviations[:4] < 0.6)
    assert calibration.rms_px < 0.1


def test_a_part_of_the_board_is_a_view_too(pictures: list[bytes], views: list[BoardView]) -> None:
    grey = read_picture(pictures[0]).grey.copy()
    grey[:, : round(float(np.median(views[0].corners_px[:, 0])))] = 99
    part = find_board("part", grey, PATTERN)
    assert isinstance(part, BoardView) and 8 <= len(part.numbers) < len(views[0].numbers)
    assert part.measure_moved_px(views[0]) < 0.2


def test_a_view_that_stands_out_is_left_out(views: list[BoardView]) -> None:
    rng = np.random.default_rng(0)
    noise = rng.normal(0.0, 2.0, views[0].corners_px.shape)
    spoilt = BoardView("spoilt", views[0].corners_px + noise, views[0].numbers)
    found = calibrate([*views[1:], spoilt], PATTERN, (512, 512))
    assert list(found.rejected) == ["spoilt"] and "are usual here" in found.rejected["spoilt"]


def test_too_few_views_are_refused(views: list[BoardView]) -> None:
    with pytest.raises(ValueError, match=r"expected at least 4 views .* got 3"):
        calibrate(views[:3], PATTERN, (512, 512))


def test_views_that_are_alike_count_once(pictures: list[bytes]) -> None:
    grey = read_picture(pictures[0]).grey
    moved = cv2.warpAffine(grey, np.float32([[1, 0, 4], [0, 1, 0]]), (512, 512), borderMode=cv2.BORDER_REPLICATE)
    shown = [("a", grey), ("b", moved), ("c", read_picture(pictures[1]).grey), ("d", grey)]
    boards = find_boards(iter(shown), PATTERN, lambda _: None)
    assert [view.name for view in boards.views] == ["a", "c"]
    assert boards.useless == tuple((name, "the same view as a, which counts once") for name in "bd")


def test_a_camera_of_no_use_by_its_own_deviations_is_refused(views: list[BoardView]) -> None:
    rng = np.random.default_rng(1)
    lines = [CAMERA.project(np.add(PATTERN.points, [x, -0.08, 0.4])) for x in (-0.16, -0.12, -0.08, -0.04, 0.0)]
    upright = [BoardView(str(i), px + rng.normal(0.0, 0.05, px.shape), np.arange(35)) for i, px in enumerate(lines)]
    told = r"focal length and principal point to 5\.1 px, got [fc][xy] \d+ \+- .*more sides"
    with pytest.raises(BadInput, match=told):
        calibrate_camera(Boards(tuple(upright), np.zeros((512, 512), np.uint8), (512, 512), ()), PATTERN, with_k3=False)
    assert np.all(calibrate(views[:5], PATTERN, (512, 512)).deviations[:4] < 3.0)


@pytest.mark.parametrize("ending", ["png", "pdf"])
def test_the_board_is_printed_as_it_is_looked_for(tmp_path: Path, ending: str) -> None:
    save_board(tmp_path / f"board.{ending}", PATTERN)
    if ending == "png":
        with Image.open(tmp_path / "board.png") as page:
            assert page.width * 0.0254 / page.info["dpi"][0] == pytest.approx(9 * 0.025, abs=1e-4)
        printed = find_board("", cv2.imread(str(tmp_path / "board.png"), cv2.IMREAD_GRAYSCALE), PATTERN)
        assert isinstance(printed, BoardView) and len(printed.numbers) == 35
    with pytest.raises(BadInput, match=r"expected a \.pdf or \.png"):
        save_board(tmp_path / "board.xyz", PATTERN)


def placed(height_m: float, tilt_rad: float, upright: bool) -> Pose:
    """A board half a metre before the robot, square to it: upright, its y down, or lying, its y towards it."""
    turn = [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]
    lying = [[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]
    place = [0.5, 4 * 0.025, 0.06 + 5 * 0.025] if upright else [0.5 + 5 * 0.025, 4 * 0.025, 0.0]
    board = Pose(np.array(turn if upright else lying), np.array(place))
    return CameraMount(height_m, 0.08, tilt_rad).camera_from_robot @ board


@pytest.mark.parametrize("upright", [True, False])
def test_the_mounting_comes_back(calibration: Calibration, upright: bool) -> None:
    tilt = math.radians(4.0 if upright else 28.0)
    pose = placed(0.22 if upright else 0.3, tilt, upright)
    rng = np.random.default_rng(4)
    picture = board_picture(board_renderer(PATTERN), Optics.of(CAMERA), pose, SensorParameters(), rng)
    found = estimate_mounting(calibration, seen(picture), PATTERN, standing_at_m=0.06 if upright else None)
    got = np.array([found.height_m, found.tilt_rad, found.roll_rad, found.to_board_m, found.yaw_rad])
    want = np.array([0.22 if upright else 0.3, tilt, 0.0, 0.42, 0.0])
    assert np.all(np.abs(got - want) < [0.003, 0.006, 0.003, 0.003, 0.005])
    assert np.all(np.abs(got - want) < 4.5 * found.deviations)


def test_a_board_nowhere_near_the_floor_is_refused(calibration: Calibration) -> None:
    view = BoardView("", CAMERA.project(placed(0.2, 0.0, True).apply(PATTERN.points)), np.arange(35))
    with pytest.raises(ValueError, match="expected a board upright before the camera, got one that puts it -"):
        estimate_mounting(calibration, view, PATTERN, standing_at_m=-1.0)


def test_the_command_writes_file_report_and_picture(
    tmp_path: Path, pictures: list[bytes], capsys: pytest.CaptureFixture[str]
) -> None:
    for number, picture in enumerate(pictures):
        (tmp_path / f"{number:02d}.jpg").write_bytes(picture)
    (tmp_path / "grey.jpg").write_bytes(cv2.imencode(".jpg", np.full((512, 512), 99, np.uint8))[1].tobytes())
    out = tmp_path / "made" / "eye.toml"
    assert main(["calibrate", str(tmp_path), "--out", str(out)]) == 0
    camera, mount, deviation = load_camera(out)
    assert camera.fx == pytest.approx(402.0, abs=1.0) and mount is None
    assert 0.0 < deviation.focal < 0.01 and deviation == CameraDeviation(focal=deviation.focal)
    report = out.with_suffix(".txt").read_text()
    assert "grey.jpg: no board of 7 x 5" in report and report.strip() in capsys.readouterr().out
    picture = cv2.imread(str(out.with_suffix(".png")))
    assert picture is not None and picture.shape[:2] == (512, 1024)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "expected pictures or --camera SOURCE, got neither"),
        (["nowhere/*.jpg"], "got 'nowhere/*.jpg'"),
        (["--camera", "999999999999"], "expected a device's number from 0 to 255, got 999999999999"),
        (["--camera", "none.avi"], "--camera none.avi: unplugged"),
        (["x.jpg", "--pattern", "2x2"], "expected at least 3 x 3 inner corners"),
        (["x.jpg", "--mount-board", "standing", "--mount-image", "y.jpg"], "--lowest-mm: expected it"),
        (["x.jpg", "--forward-mm", "80"], "--mount-board: expected floor or standing"),
        (["x.jpg", "--mount-board", "floor"], "--mount-image: expected a picture"),
    ],
)
def test_wrong_options_are_named(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["calibrate", *words]) == 2
    assert message in capsys.readouterr().err


def test_a_picture_of_one_pixel_shows_no_board(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cv2.imwrite(str(tmp_path / "dot.png"), np.zeros((1, 1), np.uint8))
    assert main(["calibrate", str(tmp_path / "dot.png"), "--out", str(tmp_path / "camera.toml")]) == 2
    err = capsys.readouterr().err
    assert "no board of 7 x 5 inner corners" in err and "Traceback" not in err
