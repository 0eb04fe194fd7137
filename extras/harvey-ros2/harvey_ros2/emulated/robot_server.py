"""The emulated robot on a network: Zenoh as ``rmw_zenoh`` uses it, with a router of its own, or Cyclone DDS.

No code of the driver.
"""

from __future__ import annotations

import hashlib
import json
import socket
import struct
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import zenoh
import zenoh.ext

from harvey.errors import BadInput
from harvey_ros2.emulated.robot_emulator import RobotEmulator, write_camera_info, write_mount, write_picture
from sim.body.simulated_body import SimulatedBody
from sim.emulators.emulator import Served
from sim.faults.built_in_faults import CameraUnplugged, DroppedFrames, LateFrames, LinkLost
from world_models.files.toml.source import Source, WorldError

PICTURES_HZ = 10.0
NODE = "emulated_robot"
TYPES = {
    "odom": ("nav_msgs::msg::dds_::Odometry_", "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"),
    "camera/image_raw/compressed": (
        "sensor_msgs::msg::dds_::CompressedImage_",
        "15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a"),
    "camera/camera_info": (
        "sensor_msgs::msg::dds_::CameraInfo_", "b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275"),
    "tf_static": (
        "tf2_msgs::msg::dds_::TFMessage_", "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"),
    "hazards": (
        "irobot_create_msgs::msg::dds_::HazardDetectionVector_",
        "90913822b0a9155a64b12352ba73b2ca9248d73874ebf7700ed277b2dca57edd"),
    "clock": (
        "rosgraph_msgs::msg::dds_::Clock_", "692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564"),
}
"""What it publishes: the type of each topic, and its hash."""
KEPT = ("tf_static",)
ABSOLUTE = ("tf_static", "clock")
"""Topics that stand in no namespace."""
NO_PICTURE = frozenset((CameraUnplugged.kind, LateFrames.kind, DroppedFrames.kind))
COMMANDS = (("geometry_msgs::msg::dds_::Twist_", "cmd_vel"),
            ("geometry_msgs::msg::dds_::TwistStamped_", "cmd_vel_stamped"))


Hear = Callable[[str, bytes], None]
"""Takes a message: ``cmd_vel`` or ``cmd_vel_stamped``, and its bytes."""


class RobotNetwork(Protocol):
    """What carries the robot's messages."""

    def publish(self, name: str, cdr: bytes, /) -> None:
        """Send a message on a topic of :data:`TYPES`. May be called from any thread."""
        ...

    def listen(self, hear: Hear, /) -> None:
        """Hand over commands from now on, in a thread of the network."""
        ...

    def close(self) -> None: ...


@dataclass(frozen=True, slots=True)
class Meeting:
    """Where the robot is to be met, by ``--at`` or by the robot's file that the driver has.

    Attributes:
        router: where its Zenoh router listens; "" where it is met over Cyclone DDS.
        domain: ROS_DOMAIN_ID.
        namespace: before the names of its topics.
    """

    router: str
    domain: int = 0
    namespace: str = ""

    @property
    def where(self) -> str:
        """In words."""
        return self.router or f"domain {self.domain} of Cyclone DDS"

    def full_name(self, name: str) -> str:
        """A topic's name, without a slash in front."""
        return name if name in ABSOLUTE or not self.namespace else f"{self.namespace.strip('/')}/{name}"


def read_meeting(at: str) -> Meeting:
    """From an address of Zenoh, or the name of a robot's file; "" for any free port. Raises BadInput."""
    if not at.endswith(".toml"):
        return Meeting(at or f"tcp/127.0.0.1:{_free_port()}")
    try:
        file = Source.read(Path(at)).data
    except WorldError as error:
        raise BadInput(str(error)) from None
    domain, space = file.get("domain", 0), file.get("namespace", "")
    kind, router = file.get("middleware", "zenoh"), file.get("router", "tcp/127.0.0.1:7447")
    texts = isinstance(router, str) and isinstance(space, str)
    if not (kind in ("zenoh", "cyclonedds") and domain in range(233) and texts):
        raise BadInput(f"{at}: expected middleware = zenoh or cyclonedds, domain = 0 to 232 and texts as router and "
                       f"namespace, got {kind!r}, {domain!r}, {router!r} and {space!r}")
    return Meeting("" if kind == "cyclonedds" else router, domain, space)


class ZenohNetwork:
    """A router of Zenoh with the robot's topics: a :class:`RobotNetwork`."""

    def __init__(self, meeting: Meeting) -> None:
        """Listen as a router. Raises BadInput where that cannot be."""
        config = zenoh.Config()
        config.insert_json5("mode", '"router"')
        config.insert_json5("listen/endpoints", json.dumps([meeting.router]))
        config.insert_json5("scouting/multicast/enabled", "false")
        config.insert_json5("timestamping/enabled", "true")
        zenoh.init_log_from_env_or("off")
        try:
            self._session = zenoh.open(config)
        except zenoh.ZError as error:
            raise BadInput(f"--at {meeting.router}: expected an address where a router can listen, as "
                           f"tcp/127.0.0.1:7447, got: {str(error).splitlines()[0]}") from None
        self._meeting, self._numbers = meeting, 0
        self._publishers: dict[str, Any] = {}
        self._declared: list[Any] = []
        domain = meeting.domain
        for number, (name, (kind, digest)) in enumerate(TYPES.items()):
            full = meeting.full_name(name)
            key = f"{domain}/{full}/{kind}/RIHS01_{digest}"
            head = f"@ros2_lv/{domain}/{self._session.zid()}/0/{number + 1}/MP/%/%/{NODE}"
            quality = ":1:,1:,:,:,," if name in KEPT else "2::,5:,:,:,,"
            tail = f"%{full.replace('/', '%')}/{kind}/RIHS01_{digest}/{quality}"
            self._declared.append(self._session.liveliness().declare_token(f"{head}/{tail}"))
            if name in KEPT:
                self._publishers[name] = zenoh.ext.declare_advanced_publisher(
                    self._session, key, cache=zenoh.ext.CacheConfig(1), publisher_detection=True)
            else:
                self._publishers[name] = self._session.declare_publisher(key)

    def publish(self, name: str, cdr: bytes) -> None:
        """Send a message."""
        self._numbers += 1
        sender = hashlib.blake2b(f"{self._session.zid()} {name}".encode(), digest_size=16).digest()
        attached = struct.pack("<qqB16s", self._numbers, time.time_ns(), 16, sender)
        self._publishers[name].put(cdr, attachment=attached)

    def listen(self, hear: Hear) -> None:
        """Hand over commands."""
        def hearing(key: str) -> Callable[[Any], None]:
            return lambda sample: hear(key, sample.payload.to_bytes())

        for kind, key in COMMANDS:
            where = f"{self._meeting.domain}/{self._meeting.full_name('cmd_vel')}/{kind}/*"
            self._declared.append(self._session.declare_subscriber(where, hearing(key)))

    def close(self) -> None:
        """Say goodbye."""
        close: Callable[[], None] = self._session.close
        close()


class RobotServer:
    """A robot on a network, in real time."""

    def __init__(self, served: Served, network: RobotNetwork, where: str) -> None:
        """``where``: the robot is, in words."""
        self._served, self._network, self._where = served, network, where
        self.robot = RobotEmulator(served.ground, time.time() - served.ground.time_s)
        self._lock, self._over = threading.Lock(), threading.Event()

    def serve(self, until: Callable[[], bool]) -> None:
        """Until told to stop or interrupted; prints where it is."""
        pictures = threading.Thread(target=self._picture_loop, name="camera", daemon=True)
        body = self._served.body
        try:  # from the first word on: an open session keeps the process from ending
            self._network.listen(self._hear)
            print(f"an emulated ros2 base is at {self._where}; Ctrl-C ends it", flush=True)
            if self._served.mount is not None:
                self._publish("tf_static", write_mount(self.robot.time_s, self._served.mount))
            if body is not None:
                pictures.start()
            then = time.monotonic()
            while not until():
                time.sleep(0.004)
                now = time.monotonic()
                with self._lock:
                    self.robot.advance(min(now - then, 0.25) * self._served.speed)
                    out = self.robot.take()
                then = now
                if body is None or LinkLost.kind not in body.device_faults:
                    for name, cdr in out:
                        self._publish(name, cdr)
                if out:
                    seconds = self.robot.time_s
                    nanoseconds = round(seconds * 1e9)
                    clock = struct.pack("<iI", nanoseconds // 10**9, nanoseconds % 10**9)
                    self._publish("clock", b"\0\1\0\0" + clock)
        except KeyboardInterrupt:
            print("the base is gone", file=sys.stderr)
        finally:
            self._over.set()
            if pictures.is_alive():
                pictures.join(2.0)
            self._network.close()

    def _hear(self, key: str, cdr: bytes) -> None:
        body = self._served.body
        if body is None or LinkLost.kind not in body.device_faults:
            self._trace("<", key, cdr)
            with self._lock:
                self.robot.hear(key, cdr)

    def _publish(self, name: str, cdr: bytes) -> None:
        self._network.publish(name, cdr)
        self._trace(">", name, cdr)

    def _trace(self, direction: str, name: str, cdr: bytes) -> None:
        if self._served.trace is not None:
            self._served.trace(direction, f"{name}, {len(cdr)} bytes".encode())

    def _picture_loop(self) -> None:
        body = self._served.body
        assert body is not None
        due_s, seen, jpeg = time.monotonic(), None, b""
        while not self._over.is_set():
            if NO_PICTURE.isdisjoint(body.device_faults):
                time_s, truth = self.robot.time_s, body.truth
                here = truth.world_from_robot, truth.lights_on
                if here != seen:
                    seen, jpeg = here, body.picture()
                self._publish("camera/image_raw/compressed", write_picture(time_s, jpeg))
                if self._served.camera is not None:
                    self._publish("camera/camera_info", write_camera_info(time_s, self._served.camera))
            due_s = max(due_s + 1.0 / (PICTURES_HZ * max(1.0, self._served.speed)), time.monotonic())
            self._over.wait(max(0.001, due_s - time.monotonic()))


def serve(served: Served) -> None:
    """Serve a robot until it is over. Raises BadInput."""
    meeting = read_meeting(served.at)
    body: SimulatedBody | None = served.body
    if body is not None:
        body.picture()  # the renderer is compiled before anybody waits for a picture
    server = RobotServer(served, _open(meeting), meeting.where)
    server.serve(served.until)


def _open(meeting: Meeting) -> RobotNetwork:
    if meeting.router:
        return ZenohNetwork(meeting)
    try:
        from harvey_ros2.emulated.robot_on_dds import DdsNetwork
    except ImportError:
        raise BadInput("--at: middleware = \"cyclonedds\" needs cyclonedds: "
                       "pip install './extras/harvey-ros2[dds]'") from None
    return DdsNetwork(meeting)


def _free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])
