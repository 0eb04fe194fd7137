"""A base that listens to ``cmd_vel`` and tells its odometry: the loop is closed here, by what its wheels count.

Nothing moves without fresh odometry and, where the camera is on ROS too, fresh pictures. A stop is said again until the
odometry says that the robot stands.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from blackboard import Sink
from harvey.hardware.drivers.base_driver import Base, BaseFault, BaseKind, BytePipe
from harvey.runner.teller import Tell
from harvey_ros2.company.ros2_company import RosCompany
from harvey_ros2.messages.messages import MessageError, stamp
from harvey_ros2.messages.pipe import PipeMessages
from harvey_ros2.robot.laser_scan import read_scan
from harvey_ros2.robot.node import RobotMessages, RosNode, open_node
from harvey_ros2.robot.odometry import Counted, OdometryFault, OdometryReader
from harvey_ros2.robot.robot_file import SCAN, DriveSettings, RobotFile, ScanMount
from world_models.building.world import World
from world_models.entries import Contact, MotionReport, MotorCommand, Odometry, Ranges
from world_models.frames import wrap_angle
from world_models.robot import RobotModel

SAY_S = 0.05
"""A speed is said at least this often [s]."""
STAND_S = 1.5
"""So long a robot may take from the first stop to a stand [s]."""
STALLED_S = 1.0
"""Wheels that were told to turn and counted nothing for so long are held [s]."""
DECELERATION_M, DECELERATION_RAD = 0.6, 1.5
"""By which speeds fall toward the end of a motion [m/s^2, rad/s^2]."""
CREEP_M, CREEP_RAD = 0.02, 0.06
"""Slowest speeds; some bases do not turn their wheels below [m/s, rad/s]."""
NEAR_M, NEAR_RAD = 0.0015, 0.0015
"""A motion that comes so near has arrived."""
BUMP_SIGMA_RAD = math.radians(25.0)
BUMPS = {"bump_left": 75.0, "bump_front_left": 35.0, "bump_front_center": 0.0, "bump_front_right": -35.0,
         "bump_right": -75.0}
"""Where the segments of a Create 3's bumper are [degrees], by the frames that it names."""
SCAN_S = 0.5
"""So long a scan is waited for [s]."""
OTHERS_S = 1.0
"""Who else drove so lately may still [s]."""


class Ros2Base(Base):
    """A base over ROS 2."""

    def __init__(self, messages: RobotMessages, settings: DriveSettings, scanner: ScanMount | None = None) -> None:
        """``scanner``: where its laser scanner is; None where it has none."""
        super().__init__(messages)
        self._messages, self._settings, self._scanner = messages, settings, scanner
        self._reader = OdometryReader(messages.types, settings.fresh_s)
        self._newest: Counted | None = None
        self._other_s = -math.inf
        self._said_s = -math.inf
        self._bump: tuple[float, float] | None = None
        self._ranges: Ranges | None = None

    def _carried_out(self, command: MotorCommand) -> MotionReport:
        self._forget_what_waits()
        start = self._wait_for_odometry()
        self._check_pictures()
        speed = min(self._settings.speed_m_per_s, command.speed_m_per_s or math.inf)
        self._so_far = MotionReport(0.0, 0.0, 0.0, 0.0)
        began_s, turned, moved = self._messages.now(), 0.0, 0.0

        def report(turn_rad: float, move_m: float) -> None:
            self._so_far = MotionReport(turn_rad, move_m, self._messages.now() - began_s, 0.0)

        if command.turn_rad:
            turned = self._servo(start, command.turn_rad, self._settings.turn_rad_per_s, _Turning(),
                                 lambda done: report(done, 0.0))
        if command.move_m:
            moved = self._servo(self._wait_for_odometry(), command.move_m, speed, _Moving(),
                                lambda done: report(turned, done))
        report(turned, moved)
        assert self._so_far is not None
        return self._so_far

    def _servo(
        self, start: Counted, wanted: float, speed: float, kind: _Turning | _Moving, report: Callable[[float], None],
    ) -> float:
        """One motion, until the wheels have counted it and stand; returns what they counted. Raises BaseFault."""
        done, began_s = 0.0, self._messages.now()
        progressed_s, furthest, last = began_s, 0.0, start
        longest_s = 3.0 * abs(wanted) / speed + 6.0
        while (left := wanted - done) * math.copysign(1.0, wanted) > kind.near:
            if self._stop_asked.is_set():
                self._break_off("stopped", "somebody asked it to stop")
            if self._bump is not None:
                self._touch(kind)
            now_s = self._messages.now()
            if now_s - progressed_s > STALLED_S:
                self._contact = Contact.of_stall(now_s, turning=isinstance(kind, _Turning))
                self._break_off("stalled", f"its wheels counted nothing for {STALLED_S:g} s")
            if now_s - began_s > longest_s:
                self._break_off("refused", f"it is not done after {longest_s:.0f} s")
            self._check_others()
            self._say(kind, math.copysign(max(kind.creep, min(speed, kind.slowing(abs(left)))), wanted))
            try:
                self._check_pictures()
                counted = self._wait_for_odometry()
            except BaseFault as fault:
                raise self._broken_off(fault.kind, fault.detail) from None
            done += kind.step(last, counted)
            last = counted
            report(done)
            if abs(done) > furthest + kind.near / 4.0:
                progressed_s, furthest = now_s, abs(done)
        end = self._stand()
        done += kind.step(last, end)
        report(done)
        return done

    def _halt(self) -> None:
        self._stand()

    def _stand(self) -> Counted:
        """Say stop until it stands; the reading that says so. Raises BaseFault."""
        ends_s, standing = self._messages.now() + STAND_S, 0
        before = self._newest
        while True:
            self._say(_Moving(), 0.0, again=True)
            counted = self._next_odometry(SAY_S)
            if counted is not None:
                still = before is not None and _apart(before, counted) and counted.is_standing
                standing, before = standing + 1 if still else 0, counted
                if standing >= 2:
                    return counted
            if self._messages.now() >= ends_s:
                detail = ("it does not come to a stand" if counted is not None
                          else f"no odometry for {STAND_S:g} s after a stop")
                raise self._fault("silent", detail)

    def _read_odometry(self) -> Odometry:
        return self._wait_for_odometry().odometry

    def _read_ranges(self) -> Ranges | None:
        """The next scan that comes whole; None where none comes in time."""
        self._ranges, ends_s = None, self._messages.now() + SCAN_S
        while self._scanner is not None and self._ranges is None and (left_s := ends_s - self._messages.now()) > 0.0:
            self._next_odometry(min(left_s, SAY_S))
        return self._ranges

    def _after_reopening(self) -> None:
        self._reader.forget()

    def _wait_for_odometry(self) -> Counted:
        """A reading that was not known before; meanwhile what was said is said again. Raises BaseFault."""
        ends_s = self._messages.now() + self._settings.fresh_s
        while (left_s := ends_s - self._messages.now()) > 0.0:
            counted = self._next_odometry(min(left_s, SAY_S))
            if counted is not None:
                return counted
        passed = ", ".join(f"{number} {kind}" for kind, number in sorted(self._reader.passed_over.items()))
        raise self._fault("silent", f"no odometry for {self._settings.fresh_s:g} s"
                                    f"{f' (passed over so far: {passed})' if passed else ''}")

    def _next_odometry(self, timeout_s: float) -> Counted | None:
        """The next reading within a time, all else that was said taken note of. Raises BaseFault."""
        ends_s = self._messages.now() + timeout_s
        while (heard := self._messages.receive(max(0.0, ends_s - self._messages.now()))) is not None:
            key, message = heard
            if key == "odom":
                try:
                    counted = self._reader.read(message)
                except OdometryFault as fault:
                    self._reader.forget()
                    raise self._fault("nonsense", str(fault)) from None
                if counted is not None:
                    self._newest = counted
                    return counted
            elif key == "cmd_vel" and not self._messages.is_ours(key, message):
                self._other_s = message.came_s
            elif key == "hazards":
                self._note_hazards(message.cdr)
            elif key == "scan" and self._scanner is not None:
                self._note_scan(message.cdr, self._scanner)
        return None

    def _forget_what_waits(self) -> None:
        """RobotMessages that came before a motion tell nothing of it, but who else drives."""
        self._bump = None
        while self._next_odometry(0.0) is not None:
            pass
        self._bump = None

    def _note_hazards(self, cdr: bytes) -> None:
        try:
            found = self._messages.types.decode(cdr, "irobot_create_msgs/msg/HazardDetectionVector")
        except MessageError:
            return
        bumps = [BUMPS.get(hazard.header.frame_id, 0.0) for hazard in found.detections if hazard.type == 1]
        if bumps:
            self._bump = math.radians(sum(bumps) / len(bumps)), BUMP_SIGMA_RAD

    def _note_scan(self, cdr: bytes, scanner: ScanMount) -> None:
        with suppress(MessageError):
            self._ranges = read_scan(self._messages.types.decode(cdr, SCAN), scanner, self._messages.now())

    def _touch(self, kind: _Turning | _Moving) -> None:
        bump, self._bump = self._bump, None
        if bump is not None:
            self._contact = Contact("bumper", *bump, self._messages.now())
            self._break_off("stalled", "its bumper is pressed")

    def _check_pictures(self) -> None:
        age_s = self._messages.picture_age_s()
        if age_s is not None and age_s > self._settings.pictures_s:
            raise self._fault("silent", f"no picture for {age_s:.1f} s: it may not move")

    def _check_others(self) -> None:
        if self._messages.now() - self._other_s < OTHERS_S:
            self._break_off("refused", "somebody else publishes on its cmd_vel")

    def _break_off(self, kind: Any, detail: str) -> None:
        raise self._broken_off(kind, detail)

    def _broken_off(self, kind: Any, detail: str) -> BaseFault:
        """The fault to raise in mid-move, after it was stopped; whether that was confirmed is in it."""
        try:
            self._stand()
        except BaseFault:
            return self._fault(kind, f"{detail}; it was told to stop, and does not confirm it")
        return self._fault(kind, detail, stopped=True)

    def _say(self, kind: _Turning | _Moving, speed: float, *, again: bool = False) -> None:
        """Publish a speed; 0 stops it."""
        now_s = self._messages.now()
        if not again and speed == 0.0 and now_s - self._said_s < SAY_S:
            return
        self._said_s = now_s
        build = self._messages.types.build
        twist = {"angular": {"z": speed}} if isinstance(kind, _Turning) else {"linear": {"x": speed}}
        if self._settings.stamped:
            header = {"stamp": stamp(self._messages.time_there()), "frame_id": "base_link"}
            message = build("geometry_msgs/msg/TwistStamped", header=header, twist=twist)
        else:
            message = build("geometry_msgs/msg/Twist", **twist)
        self._messages.send("cmd_vel", message)


class AccompaniedRos2Base(Ros2Base):
    """The same on a network, where others see what the robot believes and may send it elsewhere."""

    def __init__(self, node: RosNode) -> None:
        super().__init__(node, node.robot.drive, node.robot.scan if node.robot.topics.scan else None)
        self._node, self._reader = node, OdometryReader(node.types, node.late_s)

    def accompany(self, world: World, robot: RobotModel) -> tuple[Sink, Tell]:
        """What publishes each decision, and what hands over goals."""
        company = RosCompany(self._node, world, robot)
        return company.hear, company.tell


class _Turning:
    """What a turn on the spot is counted by."""

    near, creep = NEAR_RAD, CREEP_RAD

    def step(self, before: Counted, now: Counted) -> float:
        return wrap_angle(now.odometry.heading_rad - before.odometry.heading_rad)

    def slowing(self, left: float) -> float:
        return math.sqrt(2.0 * DECELERATION_RAD * left) * 0.7


class _Moving:
    """What a move ahead is counted by."""

    near, creep = NEAR_M, CREEP_M

    def step(self, before: Counted, now: Counted) -> float:
        heading = now.odometry.heading_rad
        dx, dy = now.odometry.x_m - before.odometry.x_m, now.odometry.y_m - before.odometry.y_m
        return dx * math.cos(heading) + dy * math.sin(heading)

    def slowing(self, left: float) -> float:
        return math.sqrt(2.0 * DECELERATION_M * left) * 0.7


def _apart(before: Counted, now: Counted) -> bool:
    """Whether nothing moved from one reading to the next."""
    return abs(_Moving().step(before, now)) < 5e-4 and abs(_Turning().step(before, now)) < 1e-3


def open_ros2_base(where: str) -> Base:
    """The base of a robot over ROS 2. Raises OSError and BadInput."""
    node = open_node(where)
    return AccompaniedRos2Base(node)


def connect_pipe(link: BytePipe) -> Base:
    """The base behind a pipe that carries its messages: for missions with an emulated one in no real time."""
    robot = RobotFile()
    return Ros2Base(PipeMessages(link, robot.types), robot.drive)


KIND = BaseKind("ros2", 0, connect_pipe, "its own, if it has one: most stop 0.5 s after the last cmd_vel; try it",
                open_at=open_ros2_base)
