"""The emulated robot on a network: Zenoh as ``rmw_zenoh`` uses it, with a router of its own. No code of the driver."""

from __future__ import annotations

import json
import socket
import struct
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import zenoh
import zenoh.ext

from harvey.errors import BadInput
from harvey_ros2.robot_emulator import RobotEmulator, write_camera_info, write_mount, write_picture
from sim.body.simulated_body import SimulatedBody
from sim.emulators.emulator import Served
from sim.faults.built_in_faults import CameraUnplugged, DroppedFrames, LateFrames, LinkLost

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
NO_PICTURE = frozenset((CameraUnplugged.kind, LateFrames.kind, DroppedFrames.kind))
COMMANDS = (("geometry_msgs::msg::dds_::Twist_", "cmd_vel"),
            ("geometry_msgs::msg::dds_::TwistStamped_", "cmd_vel_stamped"))


class RobotServer:
    """A robot on Zenoh, in real time."""

    def __init__(self, served: Served, address: str) -> None:
        """Listen as a router. Raises BadInput where that cannot be."""
        self._served, self._address = served, address
        self.robot = RobotEmulator(served.ground, time.time() - served.ground.time_s)
        config = zenoh.Config()
        config.insert_json5("mode", '"router"')
        config.insert_json5("listen/endpoints", json.dumps([address]))
        config.insert_json5("scouting/multicast/enabled", "false")
        config.insert_json5("timestamping/enabled", "true")
        zenoh.init_log_from_env_or("off")
        try:
            self._session = zenoh.open(config)
        except zenoh.ZError as error:
            raise BadInput(f"--at {address}: expected an address where a router can listen, as tcp/127.0.0.1:7447, "
                           f"got: {str(error).splitlines()[0]}") from None
        self._lock, self._numbers = threading.Lock(), 0
        self._over = threading.Event()
        self._publishers: dict[str, Any] = {}
        self._declared: list[Any] = []
        for number, (name, (kind, digest)) in enumerate(TYPES.items()):
            key = f"0/{name}/{kind}/RIHS01_{digest}"
            head = f"@ros2_lv/0/{self._session.zid()}/0/{number + 1}/MP/%/%/{NODE}"
            quality = ":1:,1:,:,:,," if name in KEPT else "2::,5:,:,:,,"
            tail = f"%{name.replace('/', '%')}/{kind}/RIHS01_{digest}/{quality}"
            self._declared.append(self._session.liveliness().declare_token(f"{head}/{tail}"))
            if name in KEPT:
                self._publishers[name] = zenoh.ext.declare_advanced_publisher(
                    self._session, key, cache=zenoh.ext.CacheConfig(1), publisher_detection=True)
            else:
                self._publishers[name] = self._session.declare_publisher(key)
        for kind, key in COMMANDS:
            self._declared.append(self._session.declare_subscriber(f"0/cmd_vel/{kind}/*", self._hearing(key)))

    def serve(self, until: Callable[[], bool]) -> None:
        """Until told to stop or interrupted; prints where it is."""
        pictures = threading.Thread(target=self._picture_loop, name="camera", daemon=True)
        body = self._served.body
        try:  # from the first word on: an open session keeps the process from ending
            print(f"an emulated ros2 base is at {self._address}; Ctrl-C ends it", flush=True)
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
            close: Callable[[], None] = self._session.close
            close()

    def _hearing(self, key: str) -> Callable[[Any], None]:
        def hear(sample: Any) -> None:
            body = self._served.body
            if body is None or LinkLost.kind not in body.device_faults:
                cdr = sample.payload.to_bytes()
                self._trace("<", key, cdr)
                with self._lock:
                    self.robot.hear(key, cdr)

        return hear

    def _publish(self, name: str, cdr: bytes) -> None:
        self._numbers += 1
        attached = struct.pack("<qqB16s", self._numbers, time.time_ns(), 16, f"emulated {name}"[:16].encode())
        self._publishers[name].put(cdr, attachment=attached)
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
    address = served.at or f"tcp/127.0.0.1:{_free_port()}"
    body: SimulatedBody | None = served.body
    if body is not None:
        body.picture()  # the renderer is compiled before anybody waits for a picture
    server = RobotServer(served, address)
    server.serve(served.until)


def _free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])
