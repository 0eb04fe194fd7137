"""Bags of ROS 1 and 2: odometry, pictures and what the camera is, in the order of their stamps.

What is of no use is left out, and counted by why.
"""

from __future__ import annotations

import math
from bisect import insort
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Connection

from harvey.errors import BadInput
from harvey.hardware.drivers.capture import CapturedPicture, picture_of
from harvey_ros2.company.ros2_company import read_odometry
from harvey_ros2.messages.messages import seconds
from harvey_ros2.recordings.bag_file import BagFile
from harvey_ros2.robot.camera_info import Lens, field, find_own_topic, read_camera_info, state_of
from harvey_ros2.robot.odometry import HASTE, JUMP_S
from harvey_ros2.robot.picture_message import retrieve_picture
from knowledge_sources.methods.features import read_picture
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose, Pose2

ODOMETRY = "nav_msgs/msg/Odometry"
PICTURES = ("sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image")
INFO, STATIC = "sensor_msgs/msg/CameraInfo", "/tf_static"
MOST_ASIDE_M = 0.02
"""A camera further aside of the robot's axis is of no use: a mounting knows only ahead and above."""
STEEPEST = math.sin(math.radians(80.0))
"""A camera that looks up or down more steeply has axes that are not those of a picture."""
WITHIN_S = 2.0
"""Messages are put in the order of their stamps, if those are at most so far apart."""
MOST_WAITING = 200
"""So many pictures wait at most for odometry."""
FIRST_PICTURES, FIRST_INFOS = 200, 2000
"""Among so many messages the first picture that is whole, and what each camera says of itself, are looked for."""
OTHER_CLOCK_S = 1.0
"""Stamps that are so far from the time of the record are of another clock."""


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
        left_out: what was, with how often: ``pictures before the odometry begins``.
        taken: what is not as it should be and was taken, with how often; notes: what else is to be told.
        spans_s: first and last time of the stamps of ``odometry`` and ``pictures``, as far as they were read.
    """

    def __init__(self, path: Path, *, odometry: str = "", picture: str = "", distro: str = "jazzy") -> None:
        """Open it; without names the only topic of a type is taken. Raises BadInput."""
        self.path = path
        self.left_out, self.taken, self.spans_s = Counter[str](), Counter[str](), dict[str, tuple[float, float]]()
        self.notes = list[str]()
        self._file = BagFile(path, distro)
        try:
            self._odometry = self._find((ODOMETRY,), odometry, "--odom")
            self._picture = self._find(PICTURES, picture, "--picture")
        except BadInput:
            self.close()
            raise
        self.odometry, self.picture = self._odometry[0].topic, self._picture[0].topic
        self._lens: Lens | None = None
        self._size: tuple[int, int] | None = None
        self._infos: list[Connection] = []
        self._state = b""
        self._is_other = False
        self._is_by_record = self._has_other_clock()
        self._newest: dict[str, tuple[float, float]] = {}

    def __enter__(self) -> Bag:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let its files go."""
        self._file.close()

    def items(self) -> Iterator[BagItem]:
        """Odometry and pictures in the order of their stamps, within two seconds of how they were recorded."""
        waiting: list[tuple[float, int, BagItem]] = []
        number = pictures = 0
        for connection, recorded_ns, data in self._file.messages([*self._odometry, *self._picture, *self._infos]):
            item = self._read(connection, recorded_ns * 1e-9, data)
            if item is None:
                continue
            insort(waiting, (item.time_s, number, item))
            number, pictures = number + 1, pictures + (item.odometry is None)
            while waiting[0][0] < waiting[-1][0] - WITHIN_S or pictures > MOST_WAITING:
                first = waiting.pop(0)[2]
                pictures -= first.odometry is None
                yield first
        yield from (item for _, _, item in waiting)

    def find_camera(self, base: str) -> tuple[Camera, CameraMount | None]:
        """The camera by its CameraInfo, and where it is on the robot by ``tf_static``, if both frames are there.

        From then on pictures are read as this camera takes them. Raises BadInput where the bag has no CameraInfo of
        the pictures, or one that cannot be represented, or the camera is mounted as none can be here.
        """
        connections = [one for one in self._file.connections if one.msgtype == INFO]
        infos: dict[str, Any] = {}
        for connection, _, data in islice(self._file.messages(connections) if connections else (), FIRST_INFOS):
            info = self._file.decode(connection, data)
            if info is not None and not (connection.topic in infos and field(infos[connection.topic], "k")[0] > 0.0):
                infos[connection.topic] = info
            if len(infos) == len({one.topic for one in connections}) and (
                    all(field(one, "k")[0] > 0.0 for one in infos.values())):
                break
        if not infos:
            raise BadInput(f"{self.path}: expected a camera file (--calibration) or a topic of type {INFO}, got "
                           "neither")
        frame, size = self._find_first()
        try:
            topic = find_own_topic(infos, self.picture, frame, size)
            found = read_camera_info(infos[topic], self.picture)
            mount = self._find_mount(base, frame or infos[topic].header.frame_id, found.turned)
        except (BadInput, ValueError) as error:
            raise BadInput(f"{self.path}: {error}") from None
        self._lens, self._state = found.lens, state_of(infos[topic])
        self._infos = [one for one in connections if one.topic == topic]
        if found.lens is not None:
            model = infos[topic].distortion_model
            self.notes.append(f"the lens ({model}) is taken out of the pictures of {self.picture}")
        return found.camera, mount

    def check_size(self, camera: Camera) -> None:
        """Raises BadInput where the first picture is not of the size of a camera that somebody else names."""
        wide, high = self._find_first()[1]
        if (wide, high) != (camera.width, camera.height):
            raise BadInput(f"{self.path}: expected pictures of {camera.width} x {camera.height} px, as --calibration "
                           f"says, got {wide} x {high}")

    def tell(self) -> Iterator[str]:
        """What was left out and why, and what was taken otherwise, a line each."""
        yield from (*self._file.broken, *self.notes)
        yield from (f"taken: {number} {what}" for what, number in sorted(self.taken.items()))
        yield from (f"left out: {number} {what}" for what, number in sorted(self.left_out.items()))
        counted, seen = self.spans_s.get("odometry"), self.spans_s.get("pictures")
        if counted and seen and (counted[1] < seen[0] or seen[1] < counted[0]):
            yield (f"the pictures are of {seen[0]:.1f} to {seen[1]:.1f} s, the odometry is of {counted[0]:.1f} to "
                   f"{counted[1]:.1f} s: their stamps are of two clocks")

    def _find_first(self) -> tuple[str, tuple[int, int]]:
        """Frame and size [px] of the first picture that is whole. Raises BadInput."""
        why = ""
        for connection, _, data in islice(self._file.messages(self._picture), FIRST_PICTURES):
            message = self._file.decode(connection, data)
            picture = None if message is None else _retrieve(message)
            if isinstance(picture, CapturedPicture):
                return message.header.frame_id.lstrip("/"), picture.size
            why = why or picture or "that are garbled"
        raise BadInput(f"{self.path}: expected pictures in {self.picture} that can be read, got "
                       f"{f'pictures {why}' if why else 'none'}")

    def _find_mount(self, base: str, frame: str, turned: NDArray[np.float64]) -> CameraMount | None:
        edges: dict[str, tuple[str, Pose]] = {}
        static = [one for one in self._file.connections if one.topic.endswith(STATIC)]
        for connection, _, data in self._file.messages(static) if static else ():
            message = self._file.decode(connection, data)
            for one in () if message is None else message.transforms:
                if (pose := _pose(one.transform)) is not None:
                    edges[one.child_frame_id.lstrip("/")] = (one.header.frame_id.lstrip("/"), pose)
        return find_mount(edges, base.lstrip("/"), frame.lstrip("/"), turned)

    def _find(self, kinds: tuple[str, ...], wanted: str, option: str) -> list[Connection]:
        """The channels of the topic that is wanted: one that was recorded in parts, or has two senders, has several."""
        found = [one for one in self._file.connections if one.msgtype in kinds]
        topics = sorted({one.topic for one in found})
        if wanted in topics or (len(topics) == 1 and not wanted):
            return [one for one in found if one.topic == (wanted or topics[0])]
        there = f"got {', '.join(topics[:6])}" if topics else "got none"
        untyped = sorted({one.topic for one in self._file.connections if not one.msgtype})
        raise BadInput(f"{self.path}: expected {option} to name one topic of type {' or '.join(kinds)}, {there}"
                       f"{f'; without a type: {untyped[0]}' if untyped else ''}")

    def _has_other_clock(self) -> bool:
        """Whether one of both has no stamps, and those of the other are not of the record's clock."""
        stamps, off_s = [], 0.0
        for connections in (self._odometry, self._picture):
            first = next(iter(self._file.messages(connections)), None)
            message = None if first is None else self._file.decode(first[0], first[2])
            if first is None or message is None:
                return False
            stamps.append(seconds(message.header.stamp))
            off_s = max(off_s, abs(stamps[-1] - first[1] * 1e-9) if stamps[-1] else 0.0)
        return 0.0 in stamps and off_s > OTHER_CLOCK_S

    def _read(self, connection: Connection, recorded_s: float, data: bytes) -> BagItem | None:
        """One message; None where it is left out."""
        message = self._file.decode(connection, data)
        if connection.msgtype == INFO:
            if message is not None and field(message, "k")[0] > 0.0:
                self._is_other = state_of(message) != self._state
            return None
        is_odometry = connection.msgtype == ODOMETRY
        what = "readings of the odometry" if is_odometry else "pictures"
        if message is None:
            self.left_out[f"{what} that are garbled"] += 1
            return None
        time_s = seconds(message.header.stamp)
        if not time_s or self._is_by_record:
            self.taken[f"{what} by the time of the record: {'a clock of their own' if time_s else 'no stamps'}"] += 1
            time_s = recorded_s
        if why := self._compare(what, time_s, recorded_s):
            self.left_out[f"{what} whose stamps {why}"] += 1
            return None
        if is_odometry:
            counted = read_odometry(message)
            if counted is None:
                self.left_out[f"{what} that say no place"] += 1
            return None if counted is None else BagItem(time_s, counted)
        picture = _retrieve(message, self._lens)
        why = picture if isinstance(picture, str) else (
            "after its CameraInfo changed" if self._is_other else
            "of another size than the first" if self._size not in (None, picture.size) else "")
        if isinstance(picture, str) or why:
            self.left_out[f"{what} {why}"] += 1
            return None
        self._size = picture.size
        return BagItem(time_s, jpeg=picture.jpeg)

    def _compare(self, what: str, time_s: float, recorded_s: float) -> str:
        """Why a stamp is not taken: its clock was set, or the messages are not in order."""
        before_s, before_recorded_s = self._newest.get(what, (time_s, recorded_s))
        if time_s < before_s - JUMP_S:
            return f"go back by more than {JUMP_S:g} s: the clock was set, or they are out of order"
        if time_s > before_s + JUMP_S + HASTE * max(0.0, recorded_s - before_recorded_s):
            return f"go ahead by more than {JUMP_S:g} s at once"
        self._newest[what] = max(time_s, before_s), recorded_s
        name = what.rpartition(" ")[2]
        first_s, last_s = self.spans_s.get(name, (time_s, time_s))
        self.spans_s[name] = min(first_s, time_s), max(last_s, time_s)
        return ""


def read_picture_message(message: Any) -> BagItem | None:
    """A CompressedImage or an Image; None where it is not whole, or of a kind that is not understood."""
    picture = _retrieve(message)
    return None if isinstance(picture, str) else BagItem(seconds(message.header.stamp), jpeg=picture.jpeg)


def _retrieve(message: Any, lens: Lens | None = None) -> CapturedPicture | str:
    """The picture of a message, as the camera without its lens takes it; or why there is none."""
    got = retrieve_picture(message)
    if isinstance(got, str):
        return got
    picture = picture_of(got)
    if picture is not None and lens is not None:
        picture = picture_of(lens.rectify(read_picture(picture.jpeg).color[..., ::-1] if got.ndim == 1 else got))
    return "that are not whole" if picture is None else picture


def find_mount(edges: Mapping[str, tuple[str, Pose]], base: str, frame: str,
               turned: NDArray[np.float64] = np.eye(3)) -> CameraMount | None:  # noqa: B008
    """Where a camera's optical frame is on the robot; ``edges``: of each frame its parent, and its pose there.

    ``turned``: from the axes of the frame to those of the pictures (3, 3). None where no way leads from the camera to
    the base. Raises BadInput where the camera is too far aside, or its frame has not the axes of a picture.
    """
    start, pose, seen = frame, Pose(turned.T, np.zeros(3)), set[str]()
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
    if abs(ahead[2]) > STEEPEST:
        raise BadInput(f"tf_static: expected {start} with the axes of a picture (x to the right, z ahead), got one "
                       f"that looks straight {'up' if ahead[2] > 0.0 else 'down'}")
    down = pose.rotation[:, 1]
    return CameraMount(z, x, -math.asin(max(-1.0, min(1.0, float(ahead[2])))),
                       math.atan2(-float(right[2]), -float(down[2])), math.atan2(float(ahead[1]), float(ahead[0])))


def _pose(transform: Any) -> Pose | None:
    """None where the rotation is none, as zeros."""
    q, t = transform.rotation, transform.translation
    length = math.hypot(q.x, q.y, q.z, q.w)
    if not 0.9 < length < 1.1:
        return None
    x, y, z, w = np.array([q.x, q.y, q.z, q.w]) / length
    rotation = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
    return Pose(rotation, np.array([t.x, t.y, t.z]))
