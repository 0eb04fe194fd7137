"""An emulated robot that speaks ROS 2: a differential drive with odometry, bumper and camera.

It shares no code with the driver: bytes and keys are written here from the specifications of CDR and ``rmw_zenoh``.

Its wheels take the last ``cmd_vel`` for half a second, then they stop. Odometry goes out thirty times a second.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass

from sim.emulators.emulator import EmulatorKind, Ground
from world_models.camera import Camera, CameraMount

WATCHDOG_S = 0.5
ODOMETRY_S = 1.0 / 30.0
STEP_S = 0.01
MAX_SPEED_M_PER_S, MAX_TURN_RAD_PER_S = 0.5, 1.5
BUMPER = ((75.0, "bump_left"), (35.0, "bump_front_left"), (0.0, "bump_front_center"), (-35.0, "bump_front_right"),
          (-75.0, "bump_right"))
"""Segments of its bumper: direction [degrees] and frame."""


class CdrWriter:
    """Bytes of a message: little endian, each number at a multiple of its size."""

    def __init__(self) -> None:
        self._data = bytearray()

    def number(self, kind: str, *values: float) -> CdrWriter:
        """Numbers of one kind: a letter of ``struct``."""
        size = struct.calcsize(kind)
        self._data += bytes(-len(self._data) % size)
        self._data += struct.pack(f"<{len(values)}{kind}", *values)
        return self

    def text(self, text: str) -> CdrWriter:
        data = text.encode() + b"\0"
        self.number("I", len(data))
        self._data += data
        return self

    def blob(self, data: bytes) -> CdrWriter:
        self.number("I", len(data))
        self._data += data
        return self

    def header(self, time_s: float, frame: str) -> CdrWriter:
        nanoseconds = round(time_s * 1e9)
        self.number("i", nanoseconds // 10**9)
        return self.number("I", nanoseconds % 10**9).text(frame)

    @property
    def message(self) -> bytes:
        return b"\0\1\0\0" + bytes(self._data)


def read_speeds(cdr: bytes, *, stamped: bool) -> tuple[float, float] | None:
    """Speed ahead [m/s] and turning rate [rad/s] of a Twist or TwistStamped; None where it is none."""
    at = 4
    if cdr[:2] != b"\0\1":
        return None
    if stamped:
        if len(cdr) < 16:
            return None
        at = 16 + struct.unpack_from("<I", cdr, 12)[0]
        at += -(at - 4) % 8
    if len(cdr) < at + 48:
        return None
    values = struct.unpack_from("<6d", cdr, at)
    return (values[0], values[5]) if all(map(math.isfinite, values)) else None


class RobotEmulator:
    """The robot without a network: messages in, messages out, and time that passes.

    Attributes:
        stops: how often its watchdog stopped it.
    """

    def __init__(self, ground: Ground, epoch_s: float = 0.0) -> None:
        """``epoch_s``: what its clock says when the ground's says 0."""
        self._ground, self._epoch_s = ground, epoch_s
        self._out: list[tuple[str, bytes]] = []
        self._wanted = self._going = (0.0, 0.0)
        self._x = self._y = self._heading = 0.0
        self._age_s, self._due_s = math.inf, 0.0
        self.stops = 0

    @property
    def time_s(self) -> float:
        """Its clock [s]."""
        return self._epoch_s + self._ground.time_s

    @property
    def moving(self) -> bool:
        """Whether the motors run."""
        return self._wanted != (0.0, 0.0)

    def hear(self, key: str, cdr: bytes) -> None:
        """Take a message: key ``cmd_vel`` or ``cmd_vel_stamped``."""
        speeds = read_speeds(cdr, stamped=key.endswith("stamped")) if key.startswith("cmd_vel") else None
        if speeds is not None:
            most = MAX_SPEED_M_PER_S, MAX_TURN_RAD_PER_S
            self._wanted = (max(-most[0], min(most[0], speeds[0])), max(-most[1], min(most[1], speeds[1])))
            self._age_s = 0.0

    def advance(self, duration_s: float) -> None:
        """Let time pass."""
        left_s = duration_s
        while left_s > 1e-12:
            step_s = min(left_s, STEP_S)
            self._step(step_s)
            left_s -= step_s

    def take(self) -> list[tuple[str, bytes]]:
        """The messages since the last call: key and bytes."""
        out, self._out = self._out, []
        return out

    def _step(self, step_s: float) -> None:
        self._age_s += step_s
        if self._age_s > WATCHDOG_S and self.moving:
            self._wanted, self.stops = (0.0, 0.0), self.stops + 1
        speed, rate = self._wanted
        turned = moved = 0.0
        if rate and speed:
            turned, _ = self._ground.roll(rate * step_s, 0.0, step_s / 2.0)
            _, moved = self._ground.roll(0.0, speed * step_s, step_s / 2.0)
        else:
            turned, moved = self._ground.roll(rate * step_s, speed * step_s, step_s)
        self._going = moved / step_s, turned / step_s
        self._heading = math.remainder(self._heading + turned, math.tau)
        self._x += moved * math.cos(self._heading)
        self._y += moved * math.sin(self._heading)
        self._due_s -= step_s
        if self._due_s <= 0.0:
            self._due_s += ODOMETRY_S
            self._out.append(("odom", self._odometry()))
            if self.moving and self._going == (0.0, 0.0) and self._ground.touching_rad is not None:
                self._out.append(("hazards", self._bump(self._ground.touching_rad)))

    def _odometry(self) -> bytes:
        cdr = CdrWriter().header(self.time_s, "odom").text("base_link")
        cdr.number("d", self._x, self._y, 0.0, 0.0, 0.0, math.sin(self._heading / 2), math.cos(self._heading / 2))
        cdr.number("d", *(0.0,) * 36)
        cdr.number("d", self._going[0], 0.0, 0.0, 0.0, 0.0, self._going[1])
        return cdr.number("d", *(0.0,) * 36).message

    def _bump(self, direction_rad: float) -> bytes:
        _, frame = min(BUMPER, key=lambda segment: abs(segment[0] - math.degrees(direction_rad)))
        cdr = CdrWriter().header(self.time_s, "base_link").number("I", 1)
        return cdr.header(self.time_s, frame).number("B", 1).message


def write_picture(time_s: float, jpeg: bytes) -> bytes:
    """A CompressedImage."""
    return CdrWriter().header(time_s, "camera_optical").text("jpeg").blob(jpeg).message


def write_camera_info(time_s: float, camera: Camera) -> bytes:
    """A CameraInfo."""
    cdr = CdrWriter().header(time_s, "camera_optical").number("I", camera.height, camera.width).text("plumb_bob")
    terms = (0.0,) * 5 if camera.distortion is None else tuple(float(term) for term in camera.distortion)
    cdr.number("I", len(terms)).number("d", *terms)
    cdr.number("d", camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0)
    cdr.number("d", 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    cdr.number("d", camera.fx, 0.0, camera.cx, 0.0, 0.0, camera.fy, camera.cy, 0.0, 0.0, 0.0, 1.0, 0.0)
    return cdr.number("I", 0, 0, 0, 0, 0, 0).number("B", 0).message


def write_mount(time_s: float, mount: CameraMount) -> bytes:
    """A TFMessage: where the camera is on the robot, by way of the frame of its housing."""
    half = -mount.tilt_rad / 2.0, mount.yaw_rad / 2.0, -mount.roll_rad / 2.0  # about y, then z before it, then x
    housing = _product(_product((0.0, 0.0, math.sin(half[1]), math.cos(half[1])),
                                (0.0, -math.sin(half[0]), 0.0, math.cos(half[0]))),
                       (-math.sin(half[2]), 0.0, 0.0, math.cos(half[2])))
    cdr = CdrWriter().number("I", 2)
    cdr.header(time_s, "base_link").text("camera_link").number("d", mount.forward_m, 0.0, mount.height_m, *housing)
    cdr.header(time_s, "camera_link").text("camera_optical")
    return cdr.number("d", 0.0, 0.0, 0.0, -0.5, 0.5, -0.5, 0.5).message


def _product(a: tuple[float, ...], b: tuple[float, ...]) -> tuple[float, ...]:
    """Of two quaternions (x, y, z, w)."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz)


@dataclass
class PipedRobot:
    """The robot behind a pipe of bytes: an :class:`sim.emulators.emulator.Emulator`."""

    robot: RobotEmulator
    rest: bytes = b""

    def receive(self, data: bytes) -> None:
        """Take bytes: each message behind the letters R2, its lengths and its checksum."""
        self.rest += data
        while len(self.rest) >= 9:
            key_size, size, check = struct.unpack_from("<BHI", self.rest, 2)
            whole = 9 + key_size + size
            if self.rest[:2] != b"R2" or (len(self.rest) >= whole and zlib.crc32(self.rest[9:whole]) != check):
                self.rest = self.rest[1:]
                continue
            if len(self.rest) < whole:
                return
            self.robot.hear(self.rest[9:9 + key_size].decode("ascii", "replace"), self.rest[9 + key_size:whole])
            self.rest = self.rest[whole:]

    def advance(self, duration_s: float) -> None:
        """Let time pass."""
        self.robot.advance(duration_s)

    def take(self) -> bytes:
        """The bytes since the last call."""
        out = b""
        for key, cdr in self.robot.take():
            body = key.encode() + cdr
            out += struct.pack("<2sBHI", b"R2", len(key), len(cdr), zlib.crc32(body)) + body
        return out

    @property
    def moving(self) -> bool:
        """Whether the motors run."""
        return self.robot.moving


def _serve(*given: object) -> None:
    from harvey_ros2.emulated.robot_server import serve  # it needs Zenoh

    run: Callable[..., None] = serve
    run(*given)


KIND = EmulatorKind("ros2", lambda ground: PipedRobot(RobotEmulator(ground)), serve=_serve)
