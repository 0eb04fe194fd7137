"""Bags as people have them: other lenses, cameras, encodings, clocks and files give the same places, or a reason."""

from __future__ import annotations

import os
import re
import struct
import zlib
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from ros2_bag import START, Truth, check_poses, drive_bag, follow
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as RosOneWriter
from rosbags.rosbag2 import StoragePlugin, Writer

from harvey.cli import main
from harvey.errors import BadInput
from harvey_ros2.following.onlooker import FirstGuess
from harvey_ros2.messages.messages import message_types, ros_one_store
from harvey_ros2.recordings.bag_reader import Bag
from harvey_ros2.robot.picture_message import retrieve_picture

TYPES = message_types("jazzy")
PICTURE, INFO = "/camera/image_raw/compressed", "/camera/camera_info"
CASES = Path(__file__).parents[4] / "shared" / "cases4"
Message = tuple[str, Any, int]
Edit = Callable[[str, Any, int], Iterable[Message]]


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Truth]:
    """Some 1.7 s of the hallway."""
    folder = tmp_path_factory.mktemp("bags") / "short"
    return folder, drive_bag(folder, [(1.85, 1.25)])


def rewrite(bag: Path, out: Path, edit: Edit, storage: StoragePlugin = StoragePlugin.MCAP) -> Path:
    """The bag again, each message as ``edit(topic, message, time)`` has it."""
    with AnyReader([bag]) as reader, Writer(out, version=9, storage_plugin=storage) as writer:
        found: dict[str, Any] = {}
        for connection, time_ns, data in reader.messages():
            for topic, message, ns in edit(connection.topic, reader.deserialize(data, connection.msgtype), time_ns):
                kind = message.__msgtype__
                if topic not in found:
                    found[topic] = writer.add_connection(topic, kind, typestore=TYPES.store)
                writer.write(found[topic], ns, TYPES.store.serialize_cdr(message, kind))
    return out


def see(message: Any) -> Any:
    return cv2.imdecode(message.data, cv2.IMREAD_COLOR)


def with_picture(message: Any, pixels: Any, ending: str = ".png") -> Any:
    return replace(message, data=cv2.imencode(ending, pixels)[1].ravel(), format=ending[1:])


def bent(terms: list[float], model: str) -> Edit:
    """Pictures as a lens makes them, by OpenCV's way from bent to straight pixels."""
    def edit(topic: str, message: Any, ns: int) -> Iterable[Message]:
        if topic == INFO:
            message = replace(message, d=np.array(terms), distortion_model=model)
        elif topic == PICTURE:
            matrix = np.array([[401.83950774, 0.0, 255.5], [0.0, 401.83950774, 255.5], [0.0, 0.0, 1.0]])
            raw = np.stack(np.meshgrid(np.arange(512.0), np.arange(512.0)), axis=-1).reshape(-1, 1, 2)
            ends, lens = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 100, 1e-9), np.array(terms)
            undo = cv2.fisheye.undistortPoints if model == "equidistant" else cv2.undistortPoints
            straight = undo(raw, matrix, lens, P=matrix, criteria=ends)
            straight = straight.reshape(512, 512, 2).astype(np.float32)
            message = with_picture(message, cv2.remap(see(message), straight, None, cv2.INTER_CUBIC))
        return [(topic, message, ns)]
    return edit


def rectified(topic: str, message: Any, ns: int) -> Iterable[Message]:
    if topic == INFO:
        message = replace(message, d=np.array([-0.35, 0.15, 0.001, 0.0, -0.03]), k=message.k * 1.1)
    return [(topic.replace("image_raw", "image_rect_color"), message, ns)]


def binned(topic: str, message: Any, ns: int) -> Iterable[Message]:
    if topic == INFO:
        message = replace(message, binning_x=2, binning_y=2)
    elif topic == PICTURE:
        message = with_picture(message, cv2.resize(see(message), (256, 256), interpolation=cv2.INTER_AREA))
    return [(topic, message, ns)]


def region(topic: str, message: Any, ns: int) -> Iterable[Message]:
    if topic == INFO:
        message = replace(message, roi=replace(message.roi, x_offset=40, y_offset=60, width=450, height=440))
    elif topic == PICTURE:
        message = with_picture(message, see(message)[60:500, 40:490])
    return [(topic, message, ns)]


def beside_another(topic: str, message: Any, ns: int) -> Iterable[Message]:
    """A depth camera's CameraInfo before; the pictures' own has another name."""
    if topic != INFO:
        return [(topic.replace("image_raw", "photo/image"), message, ns)]
    depth = replace(message, width=320, height=240, k=message.k / 2.0)
    aside = replace(message, header=replace(message.header, frame_id="rear_optical"), k=message.k / 2.0)
    return [("/camera/depth/camera_info", depth, ns), ("/rear/camera_info", aside, ns), ("/lens/info", message, ns)]


def without_stamps(topic: str, message: Any, ns: int) -> Iterable[Message]:
    """No stamps in the pictures, and odometry by a clock that began at 0."""
    if topic in (PICTURE, "/odom"):
        stamp = message.header.stamp
        late = replace(stamp, sec=0, nanosec=0) if topic == PICTURE else replace(stamp, sec=stamp.sec - 1000)
        message = replace(message, header=replace(message.header, stamp=late))
        ns = ns if topic == PICTURE else stamp.sec * 10**9 + stamp.nanosec
    return [(topic, message, ns)]


def raw_depth_beside(topic: str, message: Any, ns: int) -> Iterable[Message]:
    """Raw pictures, padded rows; frames with a slash; every third of an encoding that is none of ours."""
    if topic != PICTURE:
        return [(topic, message, ns)]
    pixels = np.pad(see(message), ((0, 0), (0, 4), (0, 0)))
    image = TYPES.build("sensor_msgs/msg/Image", height=512, width=512, step=516 * 3, encoding="bgr8",
                        data=pixels.ravel())
    odd = replace(image, header=message.header, encoding="32FC1")
    return [("/camera/image_raw", replace(image, header=message.header), ns),
            *([("/camera/image_raw", odd, ns + 1)] if ns % 3 else [])]


@pytest.mark.parametrize("edit", [
    rectified, bent([0.2, -0.1, 0.001, -0.002, 0.02, 0.4, 0.05, 0.01], "rational_polynomial"),
    bent([0.02, -0.01, 0.003, 0.0], "equidistant"), bent([-0.2, 0.05, 0.001, 0.0], "plumb_bob"), binned, region,
    beside_another, without_stamps, raw_depth_beside], ids=[
    "rectified", "rational", "fisheye", "plumb_bob", "binned", "region", "another", "unstamped", "raw"])
def test_the_same_places_come_of_it(edit: Edit, short: tuple[Path, Truth], tmp_path: Path) -> None:
    bag, truth = short
    told, onlooker = follow(rewrite(bag, tmp_path / "bag", edit), FirstGuess(START))
    assert check_poses(told, truth, truth[0][0]) >= 7 and not onlooker.is_lost


@pytest.mark.parametrize("term", [-0.1, 0.05])
def test_a_lens_that_bends_otherwise_than_is_told_is_named(
    term: float, short: tuple[Path, Truth], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = rewrite(short[0], tmp_path / "bag", change_info(d=np.array([term, 0.0, 0.0, 0.0, 0.0])))
    given = "--world", "research_center", "--start", START, "--reach", "0.951", "--out", str(tmp_path / "run")
    assert main(["follow", str(bag), *given]) == 1
    said = capsys.readouterr().out
    named = re.search(r"a lens whose first term is ([+-][0-9.]+) more than stated", said)
    assert named is not None and abs(float(named[1]) + term) <= 0.02
    assert " 0 certified" in said or "within the alert limit of 100 mm in 0 of 1" in said  # nothing that could be used


def as_ros_one(bag: Path, out: Path) -> Path:
    """The bag as ROS 1 has it."""
    store = ros_one_store()
    with AnyReader([bag]) as reader, RosOneWriter(out) as writer:
        found: dict[str, Any] = {}
        for connection, time_ns, data in reader.messages():
            kind = connection.msgtype
            if connection.topic not in found:
                found[connection.topic] = writer.add_connection(connection.topic, kind, typestore=store)
            message = _as_old(reader.deserialize(data, kind), store)
            writer.write(found[connection.topic], time_ns, store.serialize_ros1(message, kind))
    return out


def _as_old(value: Any, store: Any) -> Any:
    """A message of ROS 2 with the fields of ROS 1: a sequence number, and large letters of CameraInfo."""
    if isinstance(value, list):
        return [_as_old(one, store) for one in value]
    kind = getattr(value, "__msgtype__", None)
    if kind is None:
        return value
    names = [name for name, _ in store.fielddefs[kind][1]]
    return store.types[kind](**{name: 0 if name == "seq" else _as_old(
        getattr(value, name if hasattr(value, name) else name.lower()), store) for name in names})


def records(file: Path) -> list[tuple[int, bytes]]:
    """The records of an mcap: kind and bytes."""
    data, at, found = file.read_bytes(), 8, []
    while at < len(data) - 8:
        kind, size = struct.unpack_from("<BQ", data, at)
        found.append((kind, data[at:at + 9 + size]))
        at += 9 + size
    return found


def test_files_without_index_cut_renamed_or_of_ros_1_are_read(short: tuple[Path, Truth], tmp_path: Path) -> None:
    bag, _ = short
    mcap = bag / "short.mcap"
    data = mcap.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[:len(data) * 2 // 3])
    (tmp_path / "noname").write_bytes(data)
    unclosed = tmp_path / "unclosed"
    unclosed.mkdir()
    chunks = [one for kind, one in records(mcap) if kind in (1, 6)]
    (unclosed / "short_0.mcap").write_bytes(b"".join([data[:8], *chunks]))
    old = as_ros_one(bag, tmp_path / "old.bag")
    (tmp_path / "old.bag.active").write_bytes(old.read_bytes()[:-20_000])
    rewrite(bag, tmp_path / "rows", lambda *message: [message], StoragePlugin.SQLITE3)

    def count(path: Path) -> tuple[int, int, str]:
        with Bag(path) as recording:
            recording.find_camera("base_link")
            items = list(recording.items())
            return (sum(item.odometry is None for item in items), sum(item.odometry is not None for item in items),
                    "; ".join(recording.tell()))

    whole = count(bag)
    assert whole[0] >= 8 and whole[2] == ""
    for path in (mcap, tmp_path / "noname", old, tmp_path / "rows", tmp_path / "rows" / "rows.db3"):
        assert count(path) == whole, path
    assert count(unclosed)[:2] == whole[:2] and "short_0.mcap breaks off after" in count(unclosed)[2]
    for name in ("cut.mcap", "old.bag.active"):
        pictures, readings, told = count(tmp_path / name)
        assert 0 < pictures < whole[0] and readings > 0 and f"{name} breaks off after" in told


def test_what_is_left_out_is_told_with_its_count(
    short: tuple[Path, Truth], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def astray(topic: str, message: Any, ns: int) -> Iterable[Message]:
        """One picture cut, one of another size, the clock set back from the sixth on, and the camera changed."""
        if topic == PICTURE:
            number = round((ns * 1e-9 - 1000.05) / 0.2)
            if number == 1:
                message = replace(message, data=message.data[:9000])
            elif number == 2:
                message = with_picture(message, see(message)[:400])
            elif number >= 5:
                stamp = message.header.stamp
                message = replace(message, header=replace(message.header, stamp=replace(stamp, sec=stamp.sec - 900)))
        if topic == "/odom" and 1000.0 < ns * 1e-9 < 1000.1:
            message.pose.pose.orientation.z = 1e200
        if topic == INFO and ns * 1e-9 > 1000.64:
            message = replace(message, k=message.k * 1.01)
        return [(topic, message, ns)]

    with Bag(rewrite(short[0], tmp_path / "bag", astray)) as recording:
        recording.find_camera("base_link")
        pictures = [item for item in recording.items() if item.odometry is None]
        told = "\n".join(recording.tell())
    assert len(pictures) == 2 and "1 pictures that are not whole" in told and "1 pictures of another size" in told
    assert "readings of the odometry that say no place" in told
    assert "pictures whose stamps go back by more than 2 s" in told and "after its CameraInfo changed" in told

    def two_clocks(topic: str, message: Any, ns: int) -> Iterable[Message]:
        if topic == PICTURE:
            message = replace(message, header=replace(message.header, stamp=replace(message.header.stamp, sec=77)))
        return [(topic, message, ns)]

    clocks = rewrite(short[0], tmp_path / "clocks", two_clocks)
    main(["follow", str(clocks), "--world", "research_center", "--start", START, "--out", str(tmp_path / "run")])
    said = capsys.readouterr().out
    assert "pictures from before the odometry begins" in said and "their stamps are of two clocks" in said


def change_info(**fields: Any) -> Edit:
    return lambda topic, message, ns: [(topic, replace(message, **fields) if topic == INFO else message, ns)]


def as_housing(topic: str, message: Any, ns: int) -> Iterable[Message]:
    """Pictures in the frame of the camera's housing, whose x is ahead."""
    if topic in (PICTURE, INFO):
        message = replace(message, header=replace(message.header, frame_id="camera_link"))
    if topic == "/tf_static":
        message.transforms[1].transform.rotation.x = message.transforms[1].transform.rotation.y = 0.0
        message.transforms[1].transform.rotation.z, message.transforms[1].transform.rotation.w = 0.0, 1.0
    return [(topic, message, ns)]


def depth_only(topic: str, message: Any, ns: int) -> Iterable[Message]:
    return [(topic, replace(message, format="16UC1; png compressed") if topic == PICTURE else message, ns)]


@pytest.mark.parametrize(("edit", "expected"), [
    (change_info(width=1024, height=1024), "1024 x 1024 px for pictures of 512 x 512 px"),
    (change_info(binning_x=2, binning_y=2), "256 x 256 px after its binning and region for pictures of 512 x 512 px"),
    (change_info(distortion_model="mei", d=np.ones(5)), "got 'mei'"),
    (change_info(distortion_model="equidistant", d=np.ones(5)), "expected 4 finite terms of the lens equidistant"),
    (change_info(distortion_model="plumb_bob", d=np.array([0.1, np.nan, 0.0, 0.0])), "finite terms of the lens"),
    (change_info(distortion_model="rational_polynomial", d=np.array([-3.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0])),
     "expected a lens that can be taken out of the whole picture"),
    (change_info(k=np.zeros(9)), "expected K of a calibrated camera"),
    (lambda topic, message, ns: rectified(topic, replace(message, p=np.zeros(12)) if topic == INFO else message, ns),
     "expected P of a calibrated camera"),
    (lambda topic, message, ns: rectified(topic, replace(
        message, p=message.p - 40.0 * np.eye(12)[3]) if topic == INFO else message, ns), "0.100 m beside it"),
    (as_housing, "expected camera_link with the axes of a picture"),
    (depth_only, "that show depth"),
])
def test_a_camera_that_cannot_be_used_is_refused_by_name(
    edit: Edit, expected: str, short: tuple[Path, Truth], tmp_path: Path
) -> None:
    with Bag(rewrite(short[0], tmp_path / "bag", edit)) as recording, pytest.raises(BadInput) as refused:
        recording.find_camera("base_link")
    assert expected in str(refused.value) and len(str(refused.value)) < 400, refused.value


def test_files_that_are_no_bag_are_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.mcap")
    (tmp_path / "packed.mcap.zstd").write_bytes(b"\x28\xb5\x2f\xfd" + bytes(100))
    (tmp_path / "old.bag").write_bytes(b"#ROSBAG V2.0\n" + bytes(9))
    (tmp_path / "empty").mkdir()
    for name, expected in (("pipe.mcap", "no regular file"), ("packed.mcap.zstd", "compressed as a whole"),
                           ("old.bag", "to name one topic"), ("empty", "a folder without a file of a bag")):
        with pytest.raises(BadInput, match=expected):
            Bag(tmp_path / name)


@pytest.mark.parametrize("encoding", [
    "mono8", "mono16", "rgb8", "bgr8", "rgba8", "bgra8", "rgb16", "bayer_rggb8", "bayer_bggr8", "bayer_gbrg8",
    "bayer_grbg8", "yuv422", "yuv422_yuy2", "uyvy", "yuyv", "nv12", "nv21"])
@pytest.mark.parametrize("is_bigendian", [0, 1])
def test_a_raw_picture_is_what_was_encoded(encoding: str, is_bigendian: int) -> None:
    """Two halves of plain colours, encoded by hand from the definitions of sensor_msgs/image_encodings.hpp."""
    shown = np.zeros((16, 24, 3), np.uint8)
    shown[:, :12], shown[:, 12:] = (200, 60, 30), (20, 90, 220)  # blue, green, red
    blue, green, red = (shown[..., index] for index in range(3))
    grey = cv2.cvtColor(shown, cv2.COLOR_BGR2GRAY)
    y, u, v = (np.rint(parts @ shown.reshape(-1, 3).T + zero).astype(np.uint8).reshape(16, 24) for parts, zero in (
        (np.array([0.098, 0.504, 0.257]), 16), (np.array([0.439, -0.291, -0.148]), 128),
        (np.array([-0.071, -0.368, 0.439]), 128)))  # BT.601
    if encoding.startswith("bayer"):
        data = np.zeros((16, 24), np.uint8)
        for at, letter in enumerate(encoding[6:10]):
            data[at // 2::2, at % 2::2] = {"r": red, "g": green, "b": blue}[letter][at // 2::2, at % 2::2]
    elif encoding in ("yuv422", "uyvy"):
        data = np.stack([np.where(np.arange(24) % 2, v, u), y], axis=-1)
    elif encoding in ("yuyv", "yuv422_yuy2"):
        data = np.stack([y, np.where(np.arange(24) % 2, v, u)], axis=-1)
    elif encoding.startswith("nv"):
        first, second = (u, v) if encoding == "nv12" else (v, u)
        data = np.vstack([y, np.where(np.arange(24) % 2, second, first)[::2]])
    else:
        parts = {"m": [grey], "r": [red, green, blue], "b": [blue, green, red]}[encoding[0]]
        data = np.stack([*parts, *([grey] if "a" in encoding else [])], axis=-1)
    wide = np.frombuffer((data.astype(np.uint16) * 257).astype(">u2" if is_bigendian else "<u2").tobytes(), np.uint8)
    flat = wide if encoding.endswith("16") else np.ascontiguousarray(data).ravel()
    step = len(flat) // (24 if encoding.startswith("nv") else 16)
    image = TYPES.build("sensor_msgs/msg/Image", height=16, width=24, step=step, encoding=encoding, data=flat,
                        is_bigendian=is_bigendian)
    got = retrieve_picture(image)
    assert not isinstance(got, str)
    expected = grey if got.squeeze().ndim == 2 else shown
    inner = (slice(3, -3), [*range(3, 9), *range(15, 21)])  # mosaics blur where the colours meet
    assert np.max(np.abs(got.squeeze()[inner].astype(int) - expected[inner])) <= 12
    assert isinstance(retrieve_picture(replace(image, data=flat[:-step])), str)
    assert retrieve_picture(replace(image, encoding="16UC1")) == "of the encoding '16UC1'"


def test_a_picture_that_would_fill_the_memory_is_none() -> None:
    head = b"IHDR" + struct.pack(">IIBBBBB", 40_000, 40_000, 8, 0, 0, 0, 0)
    png = b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + head + struct.pack(">I", zlib.crc32(head))
    message = TYPES.build("sensor_msgs/msg/CompressedImage", format="png", data=np.frombuffer(png, np.uint8))
    assert "pixels" in str(retrieve_picture(message))


@pytest.mark.skipif(not CASES.exists(), reason="../shared/cases4 is absent")
@pytest.mark.parametrize("name", ["good.mcap", "rectified.mcap", "two-cameras.mcap", "stamps-zero.mcap", "png.mcap",
                                  "ros1.bag"])
def test_the_cases_of_others_give_the_places_of_the_good_one(name: str) -> None:
    def places(case: str) -> dict[float, Any]:
        told, _ = follow(CASES / case, FirstGuess(START))
        return {round(item.time_s, 3): item.message.pose for item in told if item.topic == "harvey/pose"}

    good, found = places("good.mcap"), places(name)
    assert len(good) == 9 and len(found) == (3 if name == "ros1.bag" else 9)
    for time_s, pose in found.items():
        there = good[time_s]
        off = np.array([pose.pose.position.x - there.pose.position.x, pose.pose.position.y - there.pose.position.y])
        c = pose.covariance
        assert off @ np.linalg.solve(np.array([[c[0], c[1]], [c[6], c[7]]]), off) < 9.0
