"""Bags of ROS 2 (sqlite3, mcap): odometry, pictures and what the camera is, in the order of their stamps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader
from rosbags.interfaces import Connection

from harvey.errors import BadInput
from harvey.hardware.drivers.capture import picture_of
from harvey_ros2.messages import BAD, message_types, seconds
from harvey_ros2.ros2_camera import read_pixels
from harvey_ros2.ros2_company import read_odometry
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose, Pose2

ODOMETRY = "nav_msgs/msg/Odometry"
PICTURES = ("sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image")
INFO, STATIC = "sensor_msgs/msg/CameraInfo", "/tf_static"
MOST_ASIDE_M = 0.02
"""A camera further aside of the robot's axis is of no use: a mounting knows only ahead and above."""


@dataclass(frozen=True, slots=True)
class BagItem:
    """What a bag has at a time [s]: where the wheels count to be, or a picture as JPEG."""

    time_s: float
    odometry: Pose2 | None = None
    jpeg: bytes = b""


class Bag:
    """A bag that is read.

    Attributes:
        path: of it.
        odometry, picture: the names of the topics that are read.
    """

    def __init__(self, path: Path, *, odometry: str = "", picture: str = "", distro: str = "jazzy") -> None:
        """Open it; without names the only topic of a type is taken. Raises BadInput."""
        self.path = path
        try:
            self._reader = AnyReader([path], default_typestore=message_types(distro).store)
            self._reader.open()
        except Exception as error:  # whatever the several readers of rosbags raise for a file that is none
            raise BadInput(f"{path}: expected a bag of ROS 2, got: {error}") from None
        try:
            self._odometry = self._one((ODOMETRY,), odometry, "--odom")
            self._picture = self._one(PICTURES, picture, "--picture")
        except BadInput:
            self._reader.close()
            raise
        self.odometry, self.picture = self._odometry.topic, self._picture.topic

    def __enter__(self) -> Bag:
        return self

    def __exit__(self, *_: object) -> None:
        self._reader.close()

    def items(self) -> Iterator[BagItem]:
        """Odometry and pictures in the order of their stamps, within two seconds of how they were recorded."""
        waiting: list[tuple[float, int, BagItem]] = []
        number = 0
        for connection, _, data in self._reader.messages([self._odometry, self._picture]):
            item = self._read(connection, data)
            if item is None:
                continue
            waiting.append((item.time_s, number, item))
            number += 1
            waiting.sort()
            while waiting and waiting[0][0] < waiting[-1][0] - 2.0:
                yield waiting.pop(0)[2]
        yield from (item for _, _, item in waiting)

    def find_camera(self, base: str) -> tuple[Camera, CameraMount | None]:
        """The camera by its CameraInfo, and where it is on the robot by ``tf_static``, if both frames are there.

        Raises BadInput where the bag has no CameraInfo, or the camera is mounted as none can be here.
        """
        infos = [one for one in self._reader.connections if one.msgtype == INFO]
        for connection, _, data in self._reader.messages(infos) if infos else ():
            info = self._decode(data, connection.msgtype)
            if info is not None and info.k[0] > 0.0:
                return _camera(info), self._find_mount(base, info.header.frame_id)
        raise BadInput(f"{self.path}: expected a camera file (--calibration) or a topic of type {INFO}, got neither")

    def _find_mount(self, base: str, frame: str) -> CameraMount | None:
        edges: dict[str, tuple[str, Pose]] = {}
        static = [one for one in self._reader.connections if one.topic == STATIC]
        for connection, _, data in self._reader.messages(static) if static else ():
            message = self._decode(data, connection.msgtype)
            for one in () if message is None else message.transforms:
                edges[one.child_frame_id.lstrip("/")] = (one.header.frame_id.lstrip("/"), _pose(one.transform))
        return find_mount(edges, base, frame.lstrip("/"))

    def _one(self, kinds: tuple[str, ...], wanted: str, option: str) -> Connection:
        found = [one for one in self._reader.connections if one.msgtype in kinds]
        named = [one for one in found if one.topic == wanted]
        topics = sorted({one.topic for one in found})
        if named or (len(topics) == 1 and not wanted):
            return (named or found)[0]
        there = f"got {', '.join(topics[:6])}" if topics else "got none"
        raise BadInput(f"{self.path}: expected {option} to name one topic of type {' or '.join(kinds)}, {there}")

    def _decode(self, data: bytes, kind: str) -> Any:
        try:
            return self._reader.deserialize(data, kind)
        except BAD:
            return None

    def _read(self, connection: Connection, data: bytes) -> BagItem | None:
        """One message; None where it is garbled, or a picture of a kind that is not understood."""
        message = self._decode(data, connection.msgtype)
        if message is None:
            return None
        time_s = seconds(message.header.stamp)
        if connection.msgtype == ODOMETRY:
            counted = read_odometry(message)
            return None if counted is None else BagItem(time_s, counted)
        return read_picture_message(message)


def read_picture_message(message: Any) -> BagItem | None:
    """A CompressedImage or an Image; None where it is not whole, or of a kind that is not understood."""
    time_s = seconds(message.header.stamp)
    if hasattr(message, "format"):
        jpeg = bytes(message.data)
        return BagItem(time_s, jpeg=jpeg) if jpeg.startswith(b"\xff\xd8") else None
    pixels = read_pixels(message)
    picture = None if pixels is None else picture_of(pixels)
    return None if picture is None else BagItem(time_s, jpeg=picture.jpeg)


def find_mount(edges: Mapping[str, tuple[str, Pose]], base: str, frame: str) -> CameraMount | None:
    """Where a camera's optical frame is on the robot; ``edges``: of each frame its parent, and its pose there.

    None where no way leads from the camera to the base. Raises BadInput where the camera is too far aside.
    """
    pose, seen = Pose.identity(), set[str]()
    while frame != base:
        if frame not in edges or frame in seen:
            return None
        seen.add(frame)
        frame, there = edges[frame]
        pose = there @ pose
    right, _, ahead = pose.rotation.T
    x, y, z = (float(value) for value in pose.translation)
    if abs(y) > MOST_ASIDE_M or z <= 0.0:
        raise BadInput(f"tf_static: expected a camera above {base}, at most {MOST_ASIDE_M} m aside of its axis, got it "
                       f"{y:.3f} m to the left and {z:.3f} m above")
    down = pose.rotation[:, 1]
    return CameraMount(z, x, -math.asin(max(-1.0, min(1.0, float(ahead[2])))),
                       math.atan2(-float(right[2]), -float(down[2])), math.atan2(float(ahead[1]), float(ahead[0])))


def _camera(info: Any) -> Camera:
    terms = np.asarray(info.d, float)
    bent: NDArray[np.float64] | None = terms[:5] if len(terms) >= 4 and np.any(terms) else None
    return Camera(float(info.k[0]), float(info.k[4]), float(info.k[2]), float(info.k[5]), int(info.width),
                  int(info.height), bent)


def _pose(transform: Any) -> Pose:
    q, t = transform.rotation, transform.translation
    x, y, z, w = np.array([q.x, q.y, q.z, q.w]) / math.hypot(q.x, q.y, q.z, q.w)
    rotation = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
    return Pose(rotation, np.array([t.x, t.y, t.z]))
