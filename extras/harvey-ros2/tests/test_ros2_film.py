"""Pictures without odometry: followed from one to the next, certain only where that is right, lost when kidnapped."""

from __future__ import annotations

import math
import os
import re
from argparse import Namespace
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
from ros2_bag import START, Truth, check_poses, drive_bag

from harvey.cli import main
from harvey_ros2.following.follow_command import build_robot, follow_film
from harvey_ros2.following.onlooker import FirstGuess, Onlooker, build_onlooker_head
from harvey_ros2.messages.messages import message_types
from harvey_ros2.messages.run_messages import RunMessages, TimedMessage
from harvey_ros2.recordings.bag_reader import Bag
from harvey_ros2.recordings.film_reader import Film, is_film
from knowledge_sources.senses.lens_monitor import lens_monitor
from sim.faults.built_in_faults import Kidnap
from world_models.files.toml.camera_file import camera_text
from world_models.files.toml.mission import ROOT, named_file
from world_models.files.toml.source import WORLDS

HZ = 5
"""Pictures a second of the recordings."""


def film_bag(folder: Path, bag: Path) -> tuple[int, Path]:
    """The pictures of a recording as files, and its camera's file; how many pictures there are."""
    folder.mkdir()
    number = 0
    with Bag(bag) as recording:
        camera, mount = recording.find_camera("base_link")
        for item in recording.items():
            if item.odometry is None:
                (folder / f"{number:05d}.jpg").write_bytes(item.jpeg)
                number += 1
    assert mount is not None
    calibration = folder.parent / "camera.toml"
    calibration.write_text(camera_text(camera, mount, ("the camera of a recording",)))
    return number, calibration


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, Path, Truth]]:
    """A folder of pictures, its camera's file, and the truth."""
    folder = tmp_path_factory.mktemp("films")
    truth = drive_bag(folder / "bag", [(4.0, 1.3), (3.0, 1.0)])
    _, calibration = film_bag(folder / "pictures", folder / "bag")
    yield folder / "pictures", calibration, truth


def test_pictures_are_followed_from_one_to_the_next_and_each_certain_pose_is_right(
    film: tuple[Path, Path, Truth], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pictures, calibration, truth = film
    shown = ["follow", str(pictures), "--rate", str(HZ), "--world", "research_center",
             "--calibration", str(calibration), "--start", START]
    assert main([*shown, "--out", str(tmp_path / "run")]) == 0
    said = capsys.readouterr().out
    assert "it knows where it is" in said and "lost 0 times" in said and "protection level" in said
    assert main(["replay", str(tmp_path / "run")]) == 0
    told = follow(pictures, calibration)
    checked = len(list(pictures.iterdir()))
    assert check_poses(told, truth, truth[0][0]) > 0.9 * checked
    assert not any(item.topic == "/tf" for item in told)  # there is no odometry for it


def test_carried_off_it_is_lost_within_three_seconds_and_nothing_is_certain(tmp_path: Path) -> None:
    kidnap = Kidnap(after_m=1.5, forward_m=2.0, left_m=0.3, turn_rad=math.radians(50.0))
    truth = drive_bag(tmp_path / "bag", [(4.0, 1.3), (5.5, 1.3)], faults=(kidnap,))
    (jump_s,) = [time_s - truth[0][0] for (_, before), (time_s, after) in pairwise(truth)
                 if before.distance_to(after) > 0.5]
    _, calibration = film_bag(tmp_path / "pictures", tmp_path / "bag")
    told = follow(tmp_path / "pictures", calibration, until_s=jump_s + 3.0)
    assert check_poses(told, truth, truth[0][0]) > 10
    said = [(item.time_s, item.message.status[0].message) for item in told if item.topic == "/diagnostics"]
    assert any(message.startswith("lost") and 0.0 < time_s - jump_s < 3.0 for time_s, message in said)


def test_a_source_that_raises_is_said_and_then_nothing_is_sure(
    film: tuple[Path, Path, Truth], tmp_path: Path, may_refuse: None, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def break_down(*_: object) -> None:
        raise ValueError("broken")

    few = tmp_path / "pictures"
    few.mkdir()
    for picture in sorted(film[0].iterdir())[:4]:
        (few / picture.name).write_bytes(picture.read_bytes())
    monkeypatch.setattr(type(lens_monitor), "bind", break_down)
    assert main(["follow", str(few), "--rate", str(HZ), "--world", "research_center", "--calibration", str(film[1]),
                 "--start", START, "--out", str(tmp_path / "run")]) == 1
    assert re.search(r"does not know where it is: .* raised ValueError: broken \(\d+ times\)", capsys.readouterr().out)


def follow(pictures: Path, calibration: Path, until_s: float = math.inf) -> list[TimedMessage]:
    """What is told of pictures."""
    told: list[TimedMessage] = []
    world = named_file("research_center", WORLDS, Path())
    known, robot = build_robot(None, world, Namespace(
        calibration=str(calibration), world="research_center", reach=1.0, bag="pictures"))
    messages = RunMessages(message_types("jazzy"), known, robot.lens, robot.mount, counts=False)
    onlooker = Onlooker(build_onlooker_head("film", world, robot, FirstGuess(START)), None, told.extend,
                        messages=messages, counts=False)
    follow_film((item for item in Film(pictures, HZ).items() if item.time_s < until_s), onlooker)
    return told


def test_a_video_has_its_rate_and_the_pictures_of_a_folder_come_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    grey = [np.full((48, 64, 3), 20 * number, np.uint8) for number in range(1, 7)]
    video = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 4.0, (64, 48))
    folder = tmp_path / "pictures"
    folder.mkdir()
    for number, picture in enumerate(grey):
        video.write(picture)
        jpeg = cv2.imencode(".jpg", picture)[1].tobytes()
        (folder / f"p{12 - number}.jpg").write_bytes(jpeg + bytes(900) if number % 2 else jpeg)  # padded, as some are
    video.release()
    (folder / "p8a.jpg").write_bytes(jpeg[:-2])
    (folder / "notes.txt").write_text("")
    assert is_film(tmp_path / "v.avi") and is_film(folder) and not is_film(tmp_path)

    def shades(film: Film) -> list[tuple[float, int]]:
        return [(item.time_s, round(float(cv2.imdecode(np.frombuffer(item.jpeg, np.uint8), 0).mean()) / 20.0))
                for item in film.items()]

    assert shades(Film(tmp_path / "v.avi")) == [(0.25 * number, number + 1) for number in range(6)]
    pictures = Film(folder, 2.0)
    assert shades(pictures) == [(0.0, 6), (0.5, 5), (1.5, 4), (2.0, 3), (2.5, 2), (3.0, 1)]
    assert pictures.left_out == {"pictures that are not whole": 1}


def test_the_recording_that_ships_is_followed_and_each_certified_pose_is_within_its_protection_level(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    flat, poses, table = ROOT / "docs" / "flat", tmp_path / "poses", tmp_path / "odometry.csv"
    odometry = np.loadtxt(flat / "recording" / "odometry.tum")
    turned = 2.0 * np.degrees(np.arctan2(odometry[:, 6], odometry[:, 7]))
    table.write_text("time_s,y_m,x_m,heading_deg\n" + "".join(
        f"{row[0]},{row[2]},{row[1]},{angle}\n" for row, angle in zip(odometry, turned, strict=True)))
    given = ["follow", str(flat / "recording"), "--world", str(flat / "flat.toml"), "--start", "(hall (4,3,0))",
             "--heading", "90", "--calibration", str(flat / "recording" / "camera.toml")]
    for counted, kind in ((flat / "recording" / "odometry.tum", "csv"), (table, "tum")):
        out = ["--out", str(tmp_path / kind), "--poses", f"{poses}.{kind}"]
        assert main([*given, "--odom", str(counted), *out]) == 0
        assert "certified, lost 0 times" in capfd.readouterr().out
    truth = np.loadtxt(flat / "recording" / "truth.tum")
    header, *rows = (line.split(",") for line in Path(f"{poses}.csv").read_text().splitlines())
    certified = np.array([[float(row[n]) for n in (0, 2, 3, 5)] for row in rows if row[5]])
    there = np.transpose([np.interp(certified[:, 0], truth[:, 0], column) for column in truth.T[1:3]])
    assert header[1] == "state" and len(certified) > 20
    assert np.all(np.hypot(*(certified[:, 1:3] - there).T) < certified[:, 3])
    told = np.loadtxt(f"{poses}.tum")
    assert np.allclose(told[np.isin(told[:, 0], certified[:, 0])][:, :3], certified[:, :3], atol=1e-3)
    for text, said in (("a,b\n1,2\n", "expected a first line with time_s"), ("", "expected a first line"),
                       ("time_s,x_m,y_m,heading_rad\n1,2,nan,3\n", "bad.csv:2: expected 4 finite numbers"),
                       ("time_s,x_m,y_m,heading_rad\n1,0,0,0\n0,0,0,0\n", "expected times in order")):
        (tmp_path / "bad.csv").write_text(text)
        assert main([*given, "--odom", str(tmp_path / "bad.csv"), "--out", str(tmp_path / "bad")]) == 2
        assert said in capfd.readouterr().err
    assert main([*given, "--poses", "x.txt"]) == 2


def test_what_cannot_be_followed_is_one_line(
    film: tuple[Path, Path, Truth], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    pictures, calibration, _ = film
    (tmp_path / "bad.mp4").write_bytes(b"no video at all")
    os.mkfifo(tmp_path / "pipe.mp4")
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "1.jpg").write_bytes(b"no picture")
    small = tmp_path / "small.toml"
    small.write_text(calibration.read_text().replace("width_px = 512", "width_px = 500"))
    given = "--world", "research_center", "--calibration", str(calibration), "--out", str(tmp_path / "out")
    for arguments, said in (
        ((pictures, *given), "--rate: expected how many pictures a second"),
        ((pictures, "--rate", "nan", *given), "--rate: expected how many pictures a second"),
        ((tmp_path / "bad.mp4", *given), "expected a video"),
        ((tmp_path / "none.mp4", *given), "expected a video"),
        ((tmp_path / "pipe.mp4", *given), "no regular file"),
        ((tmp_path / "broken", "--rate", "5", *given), "expected pictures, got none that is whole"),
        ((pictures, "--rate", "5", "--world", "research_center"), "expected a camera file with a [mount]"),
        ((pictures, "--rate", "5", *given[:3], str(small), *given[4:]), "expected pictures of 500 x 512 px"),
        ((pictures, "--rate", "5", "--world", "atlantis", *given[2:]), "atlantis"),
    ):
        assert main(["follow", *map(str, arguments)]) == 2
        error = capfd.readouterr().err
        assert said in error and error.count("\n") == 1 and len(error) <= 301, error
