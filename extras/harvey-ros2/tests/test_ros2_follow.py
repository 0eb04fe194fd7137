"""Localizer mode on recordings that another controller drove: certain only where it is right, lost when kidnapped."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ros2_bag import REACH, START, Truth, check_poses, drive_bag, follow
from rosbags.rosbag2 import StoragePlugin

from harvey.cli import main
from harvey_ros2.following.follow_command import pair_with_odometry
from harvey_ros2.following.onlooker import FirstGuess
from harvey_ros2.messages.run_messages import TimedMessage
from harvey_ros2.recordings.bag_reader import BagItem, find_mount
from sim.faults.built_in_faults import Kidnap
from world_models.camera import CameraMount
from world_models.entries import CameraState
from world_models.frames import Pose, Pose2, wrap_angle

WAY = [(5.0, 1.3), (8.5, 0.9), (6.5, 1.2)]


def list_states(told: list[TimedMessage]) -> list[tuple[float, str]]:
    """When it was certified, not certified or lost: each change with its time [s, of the recording]."""
    states: list[tuple[float, str]] = []
    for item in told:
        if item.topic == "/diagnostics":
            said = item.message.status[0].message.partition(":")[0]
            if not states or states[-1][1] != said:
                states.append((item.time_s, said))
    return states


@pytest.fixture(scope="module")
def carried_off(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Truth]:
    """A recording in which somebody kidnaps the robot and turns it."""
    folder = tmp_path_factory.mktemp("bags") / "carried"
    kidnap = Kidnap(after_m=2.0, forward_m=2.0, left_m=0.3, turn_rad=math.radians(50.0))
    return folder, drive_bag(folder, WAY, faults=(kidnap,))


def test_carried_off_it_is_lost_within_three_seconds_and_finds_itself(
    carried_off: tuple[Path, Truth], tmp_path: Path
) -> None:
    bag, truth = carried_off
    jumps = [time_s for (_, before), (time_s, after) in pairwise(truth)
             if before.distance_to(after) > 0.5]
    assert len(jumps) == 1
    told, onlooker = follow(bag, FirstGuess(START), tmp_path / "run")
    began_s = truth[0][0]
    states = list_states(told)
    lost_s = next(time_s for time_s, said in states if said == "lost")
    assert 0.0 < lost_s - (jumps[0] - began_s) < 3.0
    found_s = next(time_s for time_s, said in states if said == "certified" and time_s > lost_s)
    assert not onlooker.is_lost and onlooker.pictures > 40
    assert check_poses([item for item in told if not jumps[0] - began_s <= item.time_s < found_s], truth, began_s) > 25
    inside = [item for item in told if lost_s <= item.time_s < found_s]
    assert not any(item.topic == "/tf" for item in inside)
    # Between the moment when it is kidnapped and the first picture after it nobody can know.
    wrong = [item for item in told if item.topic == "harvey/pose" and item.message.pose.covariance[0] < 1e6
             and jumps[0] - began_s <= item.time_s < found_s]
    assert wrong == []
    assert main(["replay", str(tmp_path / "run")]) == 0
    assert main(["story", str(tmp_path / "run")]) == 0
    assert main(["export", str(tmp_path / "run"), "--mcap", str(tmp_path / "run.mcap")]) == 0


def test_without_a_first_guess_it_begins_lost_and_the_command_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    truth = drive_bag(tmp_path / "bag", [(3.5, 1.3)], storage=StoragePlugin.SQLITE3)
    arguments = ["follow", str(tmp_path / "bag"), "--world", "research_center", "--reach", str(REACH)]
    assert main([*arguments, "--out", str(tmp_path / "run")]) == 0
    captured = capsys.readouterr()
    assert "lost: its place is known to 5.0 m only" in captured.err and "certified" in captured.err
    assert "it knows where it is" in captured.out and "lost 1 times" in captured.out
    told, _ = follow(tmp_path / "bag", FirstGuess("(hallway (1,1,0))", sigma_m=None))
    assert check_poses(told, truth, truth[0][0]) >= 3


def test_a_camera_that_is_mounted_otherwise_than_the_recording_says_is_learnt_on_the_way(tmp_path: Path) -> None:
    def mounted(mount: CameraMount) -> CameraMount:
        return replace(mount, tilt_rad=mount.tilt_rad + math.radians(1.0), yaw_rad=mount.yaw_rad + math.radians(1.0),
                       height_m=mount.height_m + 0.02)

    truth = drive_bag(tmp_path / "bag", WAY[:2], mounted=mounted)
    told, onlooker = follow(tmp_path / "bag", FirstGuess(START))
    assert check_poses(told, truth, truth[0][0]) > 100
    last = next(item for item in reversed(told) if item.topic == "harvey/pose")
    assert math.sqrt(last.message.pose.covariance[35]) < math.radians(0.6)
    learnt = onlooker.scheduler.view.latest(CameraState)
    assert learnt is not None
    assert abs(learnt.value.mount.tilt_rad) < math.radians(0.1) and abs(learnt.value.mount.height_m - 1.0) < 0.005


def repeat(change: bool) -> Callable[[float, bytes], tuple[float, bytes]]:
    """From 5 s on one picture again and again with new stamps; or changed, by noise and compressed again."""
    kept: list[bytes] = []

    def seen(time_s: float, jpeg: bytes) -> tuple[float, bytes]:
        if time_s < 1005.0:
            return time_s, jpeg
        kept.append(jpeg)
        if not change:
            return time_s, kept[0]
        pixels = cv2.imdecode(np.frombuffer(kept[0], np.uint8), cv2.IMREAD_COLOR)
        noise = np.random.default_rng(len(kept)).normal(0.0, 2.0, pixels.shape)
        noisy = np.clip(pixels + noise, 0.0, 255.0).astype(np.uint8)
        return time_s, cv2.imencode(".jpg", noisy, [cv2.IMWRITE_JPEG_QUALITY, 92])[1].tobytes()

    return seen


@pytest.mark.parametrize(("change", "why"), [
    (False, r"the camera stands still: its picture is the same as before the wheels counted 0 degrees and 0\.06 m"),
    (True, r"motion differs, chance \d\d%, a camera whose picture does not change \d%")])
def test_a_camera_that_freezes_is_noticed_within_two_decimetres_and_certifies_nothing(
    change: bool, why: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    truth = drive_bag(tmp_path / "bag", [(4.2, 1.22)], seen=repeat(change))
    arguments = ["follow", str(tmp_path / "bag"), "--world", "research_center", "--reach", str(REACH), "--start", START]
    assert main([*arguments, "--out", str(tmp_path / "run")]) == 1
    said = capsys.readouterr().out
    assert re.match(f"the recording ends; it does not know where it is: {why}", said), said
    assert main(["replay", str(tmp_path / "run")]) == 0
    told, _ = follow(tmp_path / "bag", FirstGuess(START))
    assert check_poses(told, truth, truth[0][0]) >= 25
    certain = [item.time_s for item in told if item.topic == "harvey/pose" and item.message.pose.covariance[0] < 1e6]
    assert certain[-1] < 5.6


@pytest.mark.parametrize("lag_s", [0.1, 0.3])
def test_pictures_that_are_older_than_their_stamps_say_are_in_the_covariance_and_beyond_use_named(
    lag_s: float, tmp_path: Path
) -> None:
    truth = drive_bag(tmp_path / "bag", [(3.5, 1.3), (3.0, 0.9)], seen=lambda time_s, jpeg: (time_s + lag_s, jpeg))
    told, onlooker = follow(tmp_path / "bag", FirstGuess(START))
    assert check_poses(told, truth, truth[0][0] + lag_s) >= 30
    knows, said = onlooker.judge()
    assert knows == (lag_s < 0.2)
    named = f"its pictures are {lag_s:.2f} s older than their stamps say, by its odometry"
    assert knows or said == "lost" or named in said, said


def test_who_was_only_told_where_it_is_knows_nothing_and_odometry_that_ends_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def noise(time_s: float, jpeg: bytes) -> tuple[float, bytes]:
        pixels = np.random.default_rng(round(100 * time_s)).integers(0, 255, (512, 512), np.uint8)
        return time_s, cv2.imencode(".jpg", pixels)[1].tobytes()

    drive_bag(tmp_path / "bag", [(2.5, 1.22)], seen=noise)
    arguments = ["follow", str(tmp_path / "bag"), "--world", "research_center", "--reach", str(REACH), "--start", START]
    assert main([*arguments, "--out", str(tmp_path / "run")]) == 1
    said = capsys.readouterr().out
    assert re.search(r"the recording ends; (lost|was told where it is; 0 of \d+ pictures said so): ", said), said
    drive_bag(tmp_path / "ahead", [(2.5, 1.22)], seen=lambda time_s, jpeg: (time_s + 3.0 * (time_s > 1003.0), jpeg))
    arguments[1] = str(tmp_path / "ahead")
    assert main([*arguments, "--out", str(tmp_path / "other")]) == 1
    assert "pictures with odometry came, or said so, until 2" in capsys.readouterr().out


def test_a_pose_comes_from_between_two_readings_of_the_odometry_and_others_are_counted() -> None:
    left_out = Counter[str]()
    items = [BagItem(0.9, jpeg=b"early"), BagItem(1.0, Pose2(0.0, 0.0, 3.1)), BagItem(1.25, jpeg=b"a"),
             BagItem(2.0, Pose2(4.0, 2.0, -3.1)), BagItem(1.5, jpeg=b"astray"), BagItem(3.0, jpeg=b"paused"),
             BagItem(5.0, Pose2(4.0, 2.0, -3.1)), BagItem(5.5, jpeg=b"late")]
    (time_s, pose, jpeg), = pair_with_odometry(items, left_out)
    assert (time_s, jpeg) == (1.25, b"a") and (pose.x_m, pose.y_m) == (1.0, 0.5)
    assert abs(wrap_angle(pose.heading_rad - (3.1 + 0.25 * (2.0 * math.pi - 6.2)))) < 1e-9
    assert sorted(left_out.values()) == [1, 1, 1, 1]
    told = " ".join(sorted(left_out))
    assert all(why in told for why in ("before the odometry begins", "later times", "too late", "pauses"))


@given(st.floats(0.2, 2.0), st.floats(-0.5, 0.5), st.floats(-0.7, 0.7), st.floats(-1.0, 1.0), st.floats(-3.0, 3.0))
def test_a_mount_is_found_through_its_frames(height: float, ahead: float, tilt: float, roll: float, yaw: float) -> None:
    mount = CameraMount(height, ahead, tilt, roll, yaw)
    housing = Pose.from_rotation_vector([0.1, -0.2, 0.3], [0.02, 0.03, 0.4])
    camera = mount.camera_from_robot.inverse()
    edges = {"optical": ("housing", housing.inverse() @ camera), "housing": ("base_link", housing)}
    found = find_mount(edges, "base_link", "optical")
    assert found is not None
    for key in ("height_m", "forward_m", "tilt_rad", "roll_rad", "yaw_rad"):
        assert abs(wrap_angle(getattr(found, key) - getattr(mount, key))) < 1e-6
    assert find_mount(edges, "base_footprint", "optical") is None


def test_what_cannot_be_used_is_one_line(
    carried_off: tuple[Path, Truth], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "no.mcap").write_bytes(b"no bag at all")
    bag, out = str(carried_off[0]), str(tmp_path / "out")

    def said(*arguments: Any) -> str:
        assert main(["follow", *map(str, arguments), "--out", out]) == 2
        return capsys.readouterr().err

    for text, expected in (
        (said(tmp_path / "no.mcap", "--world", "research_center"), "expected a bag of ROS 1 or 2"),
        (said(tmp_path / "none", "--world", "research_center"), "expected a bag of ROS 1 or 2"),
        (said(bag, "--world", "atlantis"), "atlantis"),
        (said(bag, "--world", "research_center", "--start", "(moon (1,1,0))"), "moon"),
        (said(bag, "--world", "research_center", "--odom", "/wheels"), "expected --odom to name one topic"),
        (said(bag, "--world", "research_center", "--base", "base"), "expected tf_static to lead from base to the"),
        (said(bag, "--world", "research_center", "--distro", "noetic"), "expected humble, jazzy or kilted"),
    ):
        assert expected in text and text.count("\n") == 1 and len(text) <= 301, text
