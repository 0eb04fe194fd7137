"""What others on the network see and say: a localizer beside who drives, and goals for a mission."""

from __future__ import annotations

import math
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from ros2_robot import emulated

from harvey.cli import main
from harvey_ros2.company.ros2_company import describe_place
from harvey_ros2.messages.messages import message_types
from harvey_ros2.messages.middleware import Delivery, Heard, Topic
from harvey_ros2.messages.run_messages import topic_of
from harvey_ros2.messages.zenoh_middleware import ZenohMiddleware
from world_models.commands import parse_destination
from world_models.files.toml.source import WORLDS
from world_models.files.world_files import load_world
from world_models.frames import Pose2

TYPES = message_types("jazzy")
TWIST = Topic("/cmd_vel", "geometry_msgs/msg/Twist")


class Listener:
    """Another node: the newest message of each topic, and when it came."""

    def __init__(self, address: str) -> None:
        self.node = ZenohMiddleware(TYPES, "listener", router=address)
        self.heard: dict[str, list[tuple[float, Any]]] = {}
        for name in ("/tf", "harvey/pose", "/diagnostics", "harvey/plan", "harvey/landmarks"):
            topic = topic_of(name)
            self.node.subscribe(topic, self._taking(name, topic))

    def _taking(self, name: str, topic: Topic) -> Any:
        def take(heard: Heard) -> None:
            message = TYPES.decode(heard.cdr, topic.type)
            self.heard.setdefault(name, []).append((heard.came_s, message))

        return take


def drive(node: ZenohMiddleware, speed: float, rate: float, duration_s: float) -> None:
    """Somebody else drives."""
    twist = TYPES.encode(TYPES.build(TWIST.type, linear={"x": speed}, angular={"z": rate}))
    ends_s = time.monotonic() + duration_s
    while time.monotonic() < ends_s:
        node.publish(TWIST, twist)
        time.sleep(0.05)


def test_a_localizer_beside_who_drives_publishes_the_transform_while_it_is_certified(tmp_path: Path) -> None:
    with emulated(tmp_path) as robot:
        others = Listener(robot.address)
        command = [sys.executable, "-m", "harvey.cli", "follow", f"ros2:{tmp_path / 'robot.toml'}", "--world",
                   "research_center", "--calibration", str(tmp_path / "camera.toml"), "--start", "(hallway (4,4,0))",
                   "--reach", "0.951", "--out", str(tmp_path / "run")]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        try:
            ends_s = time.monotonic() + 60.0
            while "/tf" not in others.heard and time.monotonic() < ends_s and process.poll() is None:
                time.sleep(0.05)
            drive(others.node, 0.2, 0.0, 5.0)
            drive(others.node, 0.0, 0.0, 4.0)
            process.send_signal(signal.SIGINT)
            said, errors = process.communicate(timeout=30)
        finally:  # whatever went wrong: it does not end by itself
            process.kill()
        x, y = robot.places[-1]
        assert process.returncode == 0, errors
        assert "knowing where it is" in said and "lost 0 times" in said
        others.node.close()
    transform, pose = others.heard["/tf"][-1][1].transforms[0], others.heard["harvey/pose"][-1][1]
    assert (transform.header.frame_id, transform.child_frame_id) == ("map", "odom")
    assert math.hypot(pose.pose.pose.position.x - x, pose.pose.pose.position.y - y) < 0.05
    assert math.hypot(x - 4 * 0.3048, y - 4 * 0.3048) > 0.5  # it was driven
    times = [came_s for came_s, _ in others.heard["/tf"]]
    assert len(times) > 40  # ten times a second
    assert abs(pose.header.stamp.sec - time.time()) < 120.0
    assert main(["replay", str(tmp_path / "run")]) == 0


def test_a_mission_is_seen_by_others_and_sent_elsewhere_by_a_goal_pose(tmp_path: Path) -> None:
    goal = Topic("/goal_pose", "geometry_msgs/msg/PoseStamped", Delivery())
    with emulated(tmp_path) as robot:
        others = Listener(robot.address)

        def send() -> None:
            while not any(x > 4 * 0.3048 + 0.3 for x, _ in robot.places):
                time.sleep(0.02)
            message = TYPES.build(goal.type, header={"frame_id": "map"}, pose={
                "position": {"x": 7 * 0.3048, "y": 4 * 0.3048}, "orientation": {"w": 1.0}})
            for _ in range(3):
                others.node.publish(goal, TYPES.encode(message))
                time.sleep(0.1)

        sending = threading.Thread(target=send, daemon=True)
        sending.start()
        assert main(["drive", str(robot.mission), "--out", str(tmp_path / "run")]) == 0
        time.sleep(1.5)
        x, _ = robot.places[-1]
        others.node.close()
    assert abs(x - 7 * 0.3048) < 0.0254
    assert {"/tf", "harvey/pose", "harvey/plan", "harvey/landmarks", "/diagnostics"} == {*others.heard}
    assert main(["replay", str(tmp_path / "run")]) == 0


def test_a_pose_of_the_map_is_a_place_in_feet_or_none() -> None:
    world = load_world(WORLDS / "research_center.toml")
    there = Pose2(3.0, 1.2, 0.5)
    place = parse_destination(describe_place(world, there), world)
    back = place.in_world(world)
    assert place.locale == "hallway" and math.hypot(back.x_m - 3.0, back.y_m - 1.2) < 1e-5
    with pytest.raises(ValueError, match=r"expected a place within a room, got \(500\.00, 0\.00\) m"):
        describe_place(world, Pose2(500.0, 0.0, 0.0))
