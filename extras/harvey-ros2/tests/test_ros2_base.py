"""The driver of a base over ROS 2: exact motions, and what it does with messages that mislead."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, rule
from ros2_bench import TICK_S, Bench, deliver
from ros2_values import plain

from harvey.hardware.drivers.base_driver import BaseFault
from harvey_ros2.emulated.robot_emulator import (
    CdrWriter,
    RobotEmulator,
    read_speeds,
    write_camera_info,
    write_mount,
    write_picture,
)
from harvey_ros2.messages.messages import message_types, stamp
from harvey_ros2.messages.middleware import Heard, Topic
from harvey_ros2.robot.node import RosNode
from harvey_ros2.robot.odometry import OdometryFault, OdometryReader
from harvey_ros2.robot.robot_file import RobotFile
from harvey_ros2.robot.ros2_base import SAY_S
from sim.emulators.emulator import IdealGround
from world_models.camera import Camera, CameraMount
from world_models.entries import MotorCommand
from world_models.frames import Pose2

TYPES = message_types("jazzy")


@settings(max_examples=60)
@given(st.floats(-3.0, 3.0), st.floats(0.0, 3.0), st.booleans())
def test_it_reports_what_the_wheels_did_and_that_is_what_was_asked(turn: float, move: float, stamped: bool) -> None:
    bench = Bench()
    report = bench.driver(stamped=stamped).execute(MotorCommand(turn, move))
    assert abs(report.turn_rad - bench.ground.turned_rad) < 1e-6 and abs(report.move_m - bench.ground.moved_m) < 1e-6
    assert abs(report.turn_rad - turn) < 0.01 and abs(report.move_m - move) < 0.006
    assert not bench.robot.moving and all((ahead, round_) == (0.0, 0.0) for _, ahead, round_ in bench.said[-1:])


def test_it_goes_no_faster_than_it_is_told() -> None:
    bench = Bench()
    driver = bench.driver(speed_m_per_s=0.4)
    driver.execute(MotorCommand(0.0, 1.0, 0.15))
    assert max(speed for _, speed, _ in bench.said) == 0.15
    driver.execute(MotorCommand(0.0, 1.0))
    assert max(speed for _, speed, _ in bench.said) == 0.4


def cut(bench: Bench, from_m: float, most_s: float = math.inf) -> Callable[[float, str, bytes], Any]:
    """Nothing arrives once it has come so far, for some time."""
    since: list[float] = []

    def spoil(time_s: float, key: str, cdr: bytes) -> list[tuple[float, bytes, str]]:
        if bench.ground.moved_m >= from_m:
            since.append(time_s)
        gone = bool(since) and time_s - since[0] < most_s
        return [] if gone else deliver(time_s, key, cdr)

    return spoil


def test_without_odometry_it_is_stopped_at_once_and_the_fault_says_how_far_it_came() -> None:
    bench = Bench()
    bench.spoil = cut(bench, 0.5, 1.5)
    driver = bench.driver(fresh_s=0.3)
    with pytest.raises(BaseFault, match=r"silent: no odometry for 0\.3 s") as caught:
        driver.move(2.0)
    assert caught.value.stopped and caught.value.done is not None and abs(caught.value.done.move_m - 0.5) < 0.02
    assert bench.ground.moved_m < 0.5 + 0.3 * (0.3 + SAY_S + 0.1)
    bench.spoil = deliver
    assert abs(driver.move(0.2).move_m - 0.2) < 0.006


def test_a_stop_that_nobody_confirms_is_no_stop() -> None:
    bench = Bench()
    bench.spoil = cut(bench, 0.5)
    with pytest.raises(BaseFault, match="told to stop, and does not confirm it") as caught:
        bench.driver().move(2.0)
    assert not caught.value.stopped


def test_without_fresh_pictures_nothing_moves() -> None:
    bench = Bench(age_s=0.1)
    driver = bench.driver(pictures_s=1.0)
    assert driver.move(0.1).move_m > 0.09
    bench.age_s = 1.2
    with pytest.raises(BaseFault, match=r"no picture for 1\.2 s: it may not move"):
        driver.move(1.0)
    assert bench.ground.moved_m < 0.12

    def age() -> None:
        bench.age_s = 0.1 if bench.ground.moved_m < 0.6 else 1.5

    bench.age_s, bench.before_tick = 0.1, age
    with pytest.raises(BaseFault, match="no picture for") as caught:
        driver.move(2.0)
    assert caught.value.stopped and bench.ground.moved_m < 0.65


def test_odometry_that_comes_later_and_later_is_stale_by_its_stamps() -> None:
    bench = Bench()

    def fill(time_s: float, _key: str, cdr: bytes) -> list[tuple[float, bytes, str]]:
        return [(0.7 * max(0.0, time_s - 2.0), cdr, "robot")]

    bench.spoil = fill
    with pytest.raises(BaseFault, match=r"no odometry for 0\.4 s \(passed over so far: .*\d+ late") as caught:
        bench.driver().move(3.0)
    assert caught.value.kind == "silent" and bench.ground.moved_m < 0.3 * (2.0 + 0.4 / 0.7 + 0.4) + 0.2


class Silent:
    """A middleware of a node whose messages a test hands over itself."""

    def __init__(self) -> None:
        self.hear: dict[str, Callable[[Heard], None]] = {}

    def publish(self, topic: Topic, cdr: bytes) -> None:
        self.sent = topic, cdr

    def subscribe(self, topic: Topic, heard: Callable[[Heard], None]) -> None:
        self.hear[topic.name] = heard

    def sender(self, _topic: Topic) -> str:
        return "us"

    def close(self) -> None: ...


def test_pictures_age_from_when_somebody_looks_and_by_their_stamps_and_an_order_of_nobody_is_not_ours(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    network, now_s = Silent(), [100.0]
    monkeypatch.setattr(RobotFile, "open", lambda _robot: network)
    monkeypatch.setattr("harvey_ros2.robot.node.time.monotonic", lambda: now_s[0])
    node = RosNode(RobotFile())

    def show(stamp_s: float) -> None:
        header = {"stamp": {"sec": int(stamp_s), "nanosec": round(stamp_s % 1.0 * 1e9)}, "frame_id": "camera"}
        cdr = TYPES.encode(TYPES.build("sensor_msgs/msg/CompressedImage", header=header, format="jpeg"))
        network.hear["/camera/image_raw/compressed"](Heard(cdr, "robot", now_s[0]))

    assert node.picture_age_s() is None
    node.look(lambda _heard: None)
    now_s[0] += 1.6
    node.look(None)  # it is given up for unplugged, and looked for again
    assert node.picture_age_s() == pytest.approx(1.6)
    node.look(lambda _heard: None)
    assert node.picture_age_s() == pytest.approx(1.6)
    show(7.0)
    assert node.picture_age_s() == 0.0
    for k in range(3):  # each later than the one before
        now_s[0] += 0.8
        show(7.2 + 0.2 * k)
    assert node.picture_age_s() == pytest.approx(1.8, abs=0.01)
    now_s[0] += 2.0
    show(9.0)
    assert node.picture_age_s() == 0.0  # they stopped, and their clock may have
    zero, fast = (TYPES.build("geometry_msgs/msg/Twist", linear={"x": speed}) for speed in (0.0, 0.2))
    node.send("cmd_vel", zero)
    assert [node.is_ours("cmd_vel", Heard(TYPES.encode(said), sender, now_s[0])) for said, sender in (
        (zero, ""), (fast, ""), (fast, "us"), (zero, "joystick"))] == [True, False, True, False]
    assert not node.is_ours("cmd_vel", Heard(TYPES.encode(zero), "", now_s[0] + 5.0))


def test_who_else_drives_is_told_of_and_gets_no_quarrel() -> None:
    bench = Bench()
    driver = bench.driver()

    def interfere() -> None:
        if bench.ground.moved_m > 0.3:
            bench.say("cmd_vel", TYPES.encode(TYPES.build("geometry_msgs/msg/Twist")), "joystick")

    bench.before_tick = interfere
    with pytest.raises(BaseFault, match="somebody else publishes on its cmd_vel") as caught:
        driver.move(1.0)
    assert caught.value.kind == "refused" and bench.ground.moved_m < 0.4


def test_two_odometries_a_clock_that_jumps_and_wheels_that_jump_are_nonsense() -> None:
    def other_sender(time_s: float, key: str, cdr: bytes) -> list[tuple[float, bytes, str]]:
        return [(0.0, cdr, "robot" if int(time_s * 20) % 2 else "impostor")]

    def changed(change: Callable[[Any], None]) -> Callable[[float, str, bytes], list[tuple[float, bytes, str]]]:
        def spoil(time_s: float, key: str, cdr: bytes) -> list[tuple[float, bytes, str]]:
            message = TYPES.decode(cdr, "nav_msgs/msg/Odometry")
            if time_s > 1.0:
                change(message)
            return [(0.0, TYPES.encode(message), "robot")]

        return spoil

    def later(message: Any) -> None:
        message.header.stamp.sec += 3600

    def sooner(message: Any) -> None:
        message.header.stamp.sec -= 60

    def elsewhere(message: Any) -> None:
        message.pose.pose.position.x += 4.0

    for spoil, said in ((other_sender, "two publish its odometry"), (changed(later), "clock went ahead by 3600"),
                        (changed(sooner), "clock went back by 60"), (changed(elsewhere), "odometry jumped by 4")):
        bench = Bench(spoil)
        driver = bench.driver()
        with pytest.raises(BaseFault, match=said) as caught:
            driver.move(2.0)
        assert caught.value.kind == "nonsense"
        if spoil is not other_sender:  # what jumped once is as it is from now on
            assert caught.value.stopped and abs(driver.move(0.2).move_m - 0.2) < 0.006


def test_what_is_doubled_or_out_of_order_changes_nothing() -> None:
    rng = np.random.default_rng(3)

    def spoil(_time_s: float, _key: str, cdr: bytes) -> list[tuple[float, bytes, str]]:
        out = [(0.0, cdr, "robot")]
        return [*out, (float(rng.uniform(0.0, 0.3)), cdr, "robot")] if rng.random() < 0.5 else out

    bench = Bench(spoil)
    report = bench.driver().execute(MotorCommand(1.0, 1.0))
    assert abs(report.turn_rad - 1.0) < 0.01 and abs(report.move_m - 1.0) < 0.006
    assert abs(report.move_m - bench.ground.moved_m) < 1e-6


def test_a_bumper_tells_where_and_held_wheels_that_they_are() -> None:
    bench = Bench()

    def meet() -> None:
        if bench.ground.moved_m > 0.3:
            bench.ground.held, bench.ground.touching_rad = True, math.radians(40.0)

    bench.before_tick = meet
    driver = bench.driver()
    with pytest.raises(BaseFault, match="its bumper is pressed"):
        driver.move(1.0)
    contact = driver.take_contact()
    assert contact is not None and contact.by == "bumper" and abs(contact.direction_rad - math.radians(35.0)) < 1e-6
    bench.before_tick, bench.ground.touching_rad = lambda: None, None
    with pytest.raises(BaseFault, match="its wheels counted nothing for 1 s") as caught:
        driver.move(1.0)
    contact = driver.take_contact()
    assert caught.value.stopped and contact is not None and contact.by == "stall"


def test_a_stop_from_another_thread_ends_a_move() -> None:
    bench = Bench()
    driver = bench.driver()
    stops: list[threading.Thread] = []

    def ask() -> None:
        if bench.ground.moved_m > 0.3 and not stops:
            stops.append(threading.Thread(target=driver.stop))
            stops[0].start()
            while not driver._stop_asked.is_set():
                pass

    bench.before_tick = ask
    with pytest.raises(BaseFault, match="somebody asked it to stop"):
        driver.move(2.0)
    stops[0].join(5.0)
    assert bench.ground.moved_m < 0.35 and not bench.robot.moving


def test_a_process_that_begins_again_counts_on_from_where_the_last_one_ended() -> None:
    reader = OdometryReader(TYPES)

    def read(x_m: float, heading_rad: float, time_s: float, sender: str) -> Any:
        spin = {"z": math.sin(heading_rad / 2.0), "w": math.cos(heading_rad / 2.0)}
        message = TYPES.build("nav_msgs/msg/Odometry", header={"stamp": stamp(time_s)},
                              pose={"pose": {"position": {"x": x_m}, "orientation": spin}})
        found = reader.read(Heard(TYPES.encode(message), sender, time_s))
        return found and (found.odometry.x_m, found.odometry.y_m, found.odometry.heading_rad)

    assert read(2.0, math.pi / 2.0, 100.0, "first") == pytest.approx((2.0, 0.0, math.pi / 2.0))
    with pytest.raises(OdometryFault, match="two publish"):
        read(0.0, 0.0, 100.2, "second")
    reader.forget()
    assert read(0.0, 0.0, 103.0, "second") == pytest.approx((2.0, 0.0, math.pi / 2.0))
    assert read(0.1, 0.0, 103.1, "second") == pytest.approx((2.0, 0.1, math.pi / 2.0))
    reader.forget()  # the line was lost, and is there again: the same process goes on counting
    assert read(0.4, 0.0, 109.0, "second") == pytest.approx((2.0, 0.4, math.pi / 2.0))


CHAOS = 200_000
"""Messages from the robot."""


def test_chaos_moves_nothing_without_fresh_odometry_and_each_call_ends() -> None:
    rng, fresh_s = np.random.default_rng(7), 0.4
    heard_s, silent_until_s = [0.0], [0.0]

    def spoil(time_s: float, key: str, cdr: bytes) -> list[tuple[float, bytes, str]]:
        if rng.random() < 0.003:
            silent_until_s[0] = time_s + float(rng.uniform(0.0, 3.0))
        if time_s < silent_until_s[0] or rng.random() < 0.1:
            return []
        out = []
        for _ in range(2 if rng.random() < 0.1 else 1):
            data, kind = cdr, rng.random()
            if kind < 0.05:
                data = cdr[:int(rng.integers(0, len(cdr)))]
            elif kind < 0.08:
                data = rng.bytes(int(rng.integers(0, 1000)))
            elif kind < 0.10:
                at = int(rng.integers(0, len(cdr)))
                data = cdr[:at] + bytes([int(rng.integers(0, 256))]) + cdr[at + 1:]
            late_s = float(rng.exponential(0.1)) if rng.random() < 0.2 else 0.0
            out.append((late_s, data, "robot"))
        return out

    bench = Bench(spoil)
    driver = bench.driver(fresh_s=fresh_s)
    read = driver._reader.read

    def noting(heard: Any) -> Any:
        found = read(heard)
        if found is not None:
            heard_s[0] = bench.time_s
        return found

    driver._reader.read = noting  # type: ignore[method-assign]
    send, ages = bench.send, []

    def sending(key: str, message: Any) -> None:
        if (message.linear.x, message.angular.z) != (0.0, 0.0):
            ages.append(bench.time_s - heard_s[0])
        send(key, message)

    bench.send = sending  # type: ignore[method-assign]
    ended = {"done": 0}
    while bench.messages < CHAOS:
        began_s = bench.time_s
        try:
            driver.execute(MotorCommand(float(rng.uniform(-1.0, 1.0)), float(rng.uniform(0.0, 1.0))))
            ended["done"] += 1
        except BaseFault as fault:
            ended[fault.kind] = ended.get(fault.kind, 0) + 1
            bench.receive(0.5)
        assert bench.time_s - began_s < 40.0
    assert max(ages) <= fresh_s + TICK_S
    assert ended["done"] > 10 and ended["silent"] > 10, ended


def emulator_bytes() -> dict[str, bytes]:
    """A message of each kind that the emulated robot sends."""
    ground = IdealGround()
    robot = RobotEmulator(ground, epoch_s=12.5)
    robot.hear("cmd_vel", TYPES.encode(TYPES.build("geometry_msgs/msg/Twist", linear={"x": 0.2}, angular={"z": 0.3})))
    robot.advance(0.2)
    out = dict(robot.take())
    robot.hear("cmd_vel", TYPES.encode(TYPES.build("geometry_msgs/msg/Twist", linear={"x": 0.2})))
    ground.held, ground.touching_rad = True, 0.0
    robot.advance(0.1)
    camera = Camera(400.0, 410.0, 250.0, 260.0, 512, 500, (0.1, -0.2, 0.0, 0.01))
    return out | dict(robot.take()) | {
        "picture": write_picture(3.25, b"\xff\xd8 picture"), "camera_info": write_camera_info(1.0, camera),
        "mount": write_mount(1.0, CameraMount(1.0, 0.1, 0.2, 0.05, -0.03)),
    }


@pytest.mark.parametrize(("key", "name"), [
    ("odom", "nav_msgs/msg/Odometry"), ("hazards", "irobot_create_msgs/msg/HazardDetectionVector"),
    ("picture", "sensor_msgs/msg/CompressedImage"), ("camera_info", "sensor_msgs/msg/CameraInfo"),
    ("mount", "tf2_msgs/msg/TFMessage"),
])
def test_the_emulators_bytes_are_those_of_rosbags(key: str, name: str) -> None:
    data = emulator_bytes()[key]
    assert TYPES.encode(TYPES.decode(data, name)) == data


@settings(max_examples=200)
@given(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.text("abcdef", max_size=9), st.booleans())
def test_the_emulator_reads_speeds_as_rosbags_writes_them(x: float, z: float, frame: str, stamped: bool) -> None:
    twist = {"linear": {"x": x}, "angular": {"z": z}}
    message = (TYPES.build("geometry_msgs/msg/TwistStamped", header={"frame_id": frame}, twist=twist) if stamped
               else TYPES.build("geometry_msgs/msg/Twist", **twist))
    data = TYPES.encode(message)
    assert read_speeds(data, stamped=stamped) == (x, z)
    assert all(read_speeds(data[:cut], stamped=stamped) is None for cut in range(len(data)))


def test_the_emulators_writer_aligns_as_cdr_does() -> None:
    message = TYPES.build("sensor_msgs/msg/CompressedImage", header={"frame_id": "c", "stamp": {"sec": 3}},
                          format="jpeg", data=b"abc")
    assert CdrWriter().header(3.0, "c").text("jpeg").blob(b"abc").message == TYPES.encode(message)
    assert plain(TYPES.decode(write_picture(3.0, b"abc"), "sensor_msgs/msg/CompressedImage"))["format"] == "jpeg"


def test_the_emulators_own_definitions_are_those_of_ros_2() -> None:
    pytest.importorskip("cyclonedds")
    from harvey_ros2.emulated.robot_on_dds import COMMANDS, TOPICS, build_types
    from harvey_ros2.messages.dds_middleware import build_idl_class

    def describe(kind: Any) -> Any:
        kind.__idl__.populate()
        return kind.__idl__.get_type_info()

    ours = {kind: describe(build_types()[kind]) for kind in (*TOPICS.values(), *COMMANDS.values())}
    theirs = {name.split("/")[-1]: describe(build_idl_class(TYPES, name)) for name in TYPES.store.fielddefs
              if "/msg/" in name and name.split("/")[-1] in ours}
    assert ours == theirs and ours["Twist"] != ours["Clock"]


class OdometryMachine(RuleBasedStateMachine):
    """Processes of a robot, one after the other, each of which begins to count anywhere: what is read goes on."""

    def __init__(self) -> None:
        super().__init__()
        self.reader, self.time_s, self.sender = OdometryReader(TYPES), 100.0, 0
        self.counted = Pose2(2.0, -1.0, 0.7)
        self.expected = self.counted
        self.read()

    @rule(turn_rad=st.floats(-0.1, 0.1), move_m=st.floats(0.0, 0.2))
    def drive(self, turn_rad: float, move_m: float) -> None:
        step = Pose2(move_m, 0.0, turn_rad)
        self.counted, self.expected, self.time_s = self.counted @ step, self.expected @ step, self.time_s + 0.1
        self.read()

    @rule(begin=st.builds(Pose2, st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-3.0, 3.0)))
    def begin_again(self, begin: Pose2) -> None:
        self.reader.forget()
        self.counted, self.sender, self.time_s = begin, self.sender + 1, self.time_s + 3.0
        self.read()

    def read(self) -> None:
        spin = {"z": math.sin(self.counted.heading_rad / 2.0), "w": math.cos(self.counted.heading_rad / 2.0)}
        message = TYPES.build("nav_msgs/msg/Odometry", header={"stamp": stamp(self.time_s)}, pose={
            "pose": {"position": {"x": self.counted.x_m, "y": self.counted.y_m}, "orientation": spin}})
        found = self.reader.read(Heard(TYPES.encode(message), f"process {self.sender}", self.time_s))
        assert found is not None
        here = Pose2(found.odometry.x_m, found.odometry.y_m, found.odometry.heading_rad)
        assert here.distance_to(self.expected) < 1e-6
        assert math.remainder(here.heading_rad - self.expected.heading_rad, math.tau) == pytest.approx(0.0, abs=1e-6)


TestOdometry = OdometryMachine.TestCase
TestOdometry.settings = settings(max_examples=30, stateful_step_count=8, deadline=None)
