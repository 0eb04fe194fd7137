"""A run as MCAP: read back by other programs, it is the run; what is not certain is not told as certain."""

from __future__ import annotations

import hashlib
import math
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader

from harvey.cli import main
from harvey_ros2.messages.messages import message_types, seconds
from harvey_ros2.messages.run_messages import quaternion
from logs.pictures import open_pictures
from logs.run_directory import RunDirectory
from logs.run_head import RunHead
from logs.timeline import Timeline
from world_models.camera import CameraMount
from world_models.entries import Hypothesis

TYPES = message_types("jazzy")


def read_back(file: Path) -> dict[str, list[tuple[float, Any]]]:
    """Every message by its topic, with its time [s], as the package ``mcap`` finds them."""
    reader = pytest.importorskip("mcap.reader")
    found: dict[str, list[tuple[float, Any]]] = {}
    with file.open("rb") as stream:
        for schema, channel, message in reader.make_reader(stream).iter_messages():
            assert channel.message_encoding == "cdr" and schema.encoding == "ros2msg"
            found.setdefault(channel.topic, []).append(
                (message.log_time * 1e-9, TYPES.decode(message.data, schema.name)))
    return found


def export(run: RunDirectory, out: Path) -> dict[str, list[tuple[float, Any]]]:
    assert main(["export", str(run.path), "--mcap", str(out)]) == 0
    return read_back(out)


def heading(turn: Any) -> float:
    return math.atan2(2.0 * turn.w * turn.z, 1.0 - 2.0 * turn.z**2)


def flat(there: Any) -> NDArray[np.float64]:
    """(3, 3) of a Transform on the floor."""
    c, s = math.cos(heading(there.rotation)), math.sin(heading(there.rotation))
    return np.array([[c, -s, there.translation.x], [s, c, there.translation.y], [0.0, 0.0, 1.0]])


def test_a_run_is_read_back_as_it_was(recorded: Any, tmp_path: Path) -> None:
    run = recorded("office")
    found = export(run, tmp_path / "run.mcap")
    pictures = open_pictures(run)
    assert [bytes(message.data) for _, message in found["/camera/image_raw/compressed"]] == [*pictures.values()]
    held = [record.value for record in Timeline(run.journal).of_kind(Hypothesis)
            if not record.is_gone and record.value.is_held]
    assert len(found["/harvey/pose"]) == len(held)
    for times in ([time_s for time_s, _ in messages] for messages in found.values()):
        assert times == sorted(times)
    info = found["/camera/camera_info"][0][1]
    assert (info.width, info.height, info.k[0]) == (512, 512, info.p[0]) and info.k[0] > 100.0
    # By the transforms the robot is where the last pose says: map to odom, and odom to the robot.
    latest = {one.child_frame_id: flat(one.transform) for _, message in found["/tf"] for one in message.transforms}
    pose = found["/harvey/pose"][-1][1]
    here = latest["odom"] @ latest["base_link"]
    assert np.allclose(here[:2, 2], (pose.pose.pose.position.x, pose.pose.pose.position.y), atol=1e-9)
    assert pose.pose.covariance[0] < 0.1 and seconds(pose.header.stamp) > 0.0
    status = found["/diagnostics"][-1][1].status[0]
    stated = {pair.key: pair.value for pair in status.values}
    corrected = [belief for belief in held if belief.basis == "milestone"][-1]
    assert status.message == "certified"
    assert float(stated["protection level [m]"]) == pytest.approx(corrected.protection_m, abs=1e-4)
    marker = found["/harvey/landmarks"][0][1].markers[0]
    assert marker.type == 5 and len(marker.points) % 2 == 0 and len(found["/harvey/plan"][0][1].poses) >= 2


def test_its_own_bag_is_followed_without_being_lost(
    recorded: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = recorded("office")
    export(run, tmp_path / "run.mcap")
    command = RunHead.read(run.path).command
    start = command["text"].removeprefix("(ptrans ").partition("))")[0] + "))"
    assert main(["follow", str(tmp_path / "run.mcap"), "--world", "research_center", "--start", start, "--heading",
                 str(math.degrees(command["start_heading_rad"])), "--out", str(tmp_path / "followed")]) == 0
    assert "lost 0 times" in (said := capsys.readouterr().out) and "left out" not in said


def test_the_same_run_gives_the_same_file_and_the_camera_stands_where_it_is_mounted(
    recorded: Any, tmp_path: Path
) -> None:
    run = recorded("office")
    export(run, tmp_path / "one.mcap")
    found = export(run, tmp_path / "two.mcap")
    one, two = (hashlib.sha256((tmp_path / name).read_bytes()).digest() for name in ("one.mcap", "two.mcap"))
    assert one == two
    mount = found["/tf_static"][0][1].transforms[0].transform
    assert mount.translation.z == 1.0


@pytest.mark.parametrize(("tilt", "roll", "yaw"), [
    (0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.2, 0.1, -0.4), (-0.3, 3.0, 2.0)])
def test_a_quaternion_turns_as_its_rotation_does(tilt: float, roll: float, yaw: float) -> None:
    rotation = CameraMount(1.0, 0.1, tilt, roll, yaw).camera_from_robot.rotation.T
    q = quaternion(rotation)
    x, y, z, w = q["x"], q["y"], q["z"], q["w"]
    again = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
    assert np.allclose(again, rotation, atol=1e-6) and abs(x * x + y * y + z * z + w * w - 1.0) < 1e-9


def test_while_it_is_lost_no_pose_is_certain_and_no_transform_is_published(recorded: Any, tmp_path: Path) -> None:
    found = export(recorded("kidnap"), tmp_path / "run.mcap")
    said = [(time_s, message.status[0]) for time_s, message in found["/diagnostics"]]
    (lost_s, lost), = [(time_s, status) for time_s, status in said if status.message.startswith("lost")][:1]
    found_s = next(time_s for time_s, status in said if time_s > lost_s and status.message == "certified")
    assert lost.level == 2
    inside = [time_s for time_s, message in found["/tf"]
              if lost_s < time_s < found_s and message.transforms[0].child_frame_id == "odom"]
    poses = [message for time_s, message in found["/harvey/pose"] if lost_s < time_s < found_s]
    assert inside == [] and poses and all(pose.pose.covariance[0] >= 1e6 for pose in poses)


def test_rosbags_and_rerun_open_it(recorded: Any, tmp_path: Path) -> None:
    export(recorded("office"), tmp_path / "run.mcap")
    with AnyReader([tmp_path / "run.mcap"]) as reader:
        assert reader.message_count > 20
        kept = {one.topic: [profile.durability.name for profile in one.ext.offered_qos_profiles]
                for one in reader.connections}
    assert kept["/tf_static"] == ["TRANSIENT_LOCAL"] and kept["/odom"] == []
    program = shutil.which("rerun", path=str(Path(sys.executable).parent))
    assert program is not None
    check = subprocess.run([program, "mcap", "check", str(tmp_path / "run.mcap")], capture_output=True, text=True,
                           timeout=120, check=False)
    assert check.returncode == 0 and "error" not in check.stdout.lower(), check
    made = subprocess.run([program, "mcap", "convert", str(tmp_path / "run.mcap"), "-o", str(tmp_path / "run.rrd")],
                          capture_output=True, text=True, timeout=120, check=False)
    assert made.returncode == 0 and (tmp_path / "run.rrd").stat().st_size > 100_000, made


def test_a_place_that_cannot_be_written_to_is_one_line(
    recorded: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", str(recorded("office").path), "--mcap", str(tmp_path / "none" / "run.mcap")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "expected a file to write to" in said
