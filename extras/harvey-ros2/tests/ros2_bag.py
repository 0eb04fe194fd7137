"""Bags that another controller drives: the emulated robot, its camera, and somebody who knows the way."""

from __future__ import annotations

import math
from argparse import Namespace
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer

from harvey_ros2.emulated.robot_emulator import RobotEmulator, write_camera_info, write_mount, write_picture
from harvey_ros2.following.follow_command import build_robot, follow_bag
from harvey_ros2.following.onlooker import FirstGuess, Onlooker, build_onlooker_head
from harvey_ros2.messages.messages import message_types
from harvey_ros2.messages.run_messages import RunMessages, TimedMessage
from harvey_ros2.recordings.bag_reader import Bag
from sim.faults.fault import Fault
from sim.scenario import load_scenario
from sim.stage import build_stage
from world_models.camera import CameraMount
from world_models.entries import Difference
from world_models.files.toml.mission import named_file
from world_models.files.toml.source import WORLDS
from world_models.frames import Pose2, wrap_angle

TYPES = message_types("jazzy")
TICK_S, PICTURE_S = 0.05, 0.2
START = "(hallway (4,4,0))"
WORLD = named_file("research_center", WORLDS, Path())
REACH = 0.951
OPTIONS = Namespace(calibration=None, base="base_link", reach=REACH, world="research_center")
Truth = list[tuple[float, Pose2]]


def drive_bag(
    folder: Path, way: Sequence[tuple[float, float]], *, seed: int = 0, scenario: str = "forty-foot-hallway",
    faults: tuple[Fault, ...] = (), storage: StoragePlugin = StoragePlugin.MCAP,
    mounted: Callable[[CameraMount], CameraMount] = lambda mount: mount,
    seen: Callable[[float, bytes], tuple[float, bytes]] = lambda time_s, jpeg: (time_s, jpeg),
) -> Truth:
    """Drive along points [m, world] by pure pursuit on the truth, and record a bag; returns (time, true pose)s.

    ``mounted``: what the bag says of the camera's mounting, by what is true; ``seen``: stamp [s] and bytes of a picture
    in the bag, by the true ones.
    """
    stage = build_stage(replace(load_scenario(scenario), faults=faults))
    body, camera = stage.body(seed), stage.scenario.camera
    robot = RobotEmulator(body, epoch_s=1000.0)
    truth: Truth = []
    kinds = {"odom": "nav_msgs/msg/Odometry", "camera/image_raw/compressed": "sensor_msgs/msg/CompressedImage",
             "camera/camera_info": "sensor_msgs/msg/CameraInfo", "tf_static": "tf2_msgs/msg/TFMessage"}
    with Writer(folder, version=9, storage_plugin=storage) as writer:
        out = {name: writer.add_connection(f"/{name}", kind, typestore=TYPES.store) for name, kind in kinds.items()}

        def record(name: str, cdr: bytes) -> None:
            writer.write(out[name], round(robot.time_s * 1e9), cdr)

        record("tf_static", write_mount(robot.time_s, mounted(camera.mount)))
        due_s, points = 0.0, list(way)
        while points and len(truth) < 3000:
            here = body.truth.world_from_robot
            speed, rate = _pursue(here, points)
            twist: Any = TYPES.build("geometry_msgs/msg/Twist", linear={"x": speed}, angular={"z": rate})
            robot.hear("cmd_vel", TYPES.encode(twist))
            robot.advance(TICK_S)
            truth.append((robot.time_s, body.truth.world_from_robot))
            for name, cdr in robot.take():
                if name in out:
                    record(name, cdr)
            due_s -= TICK_S
            if due_s <= 0.0:
                due_s += PICTURE_S
                record("camera/image_raw/compressed", write_picture(*seen(robot.time_s, body.picture())))
                record("camera/camera_info", write_camera_info(robot.time_s, camera.camera))
    return truth


def follow(bag: Path, guess: FirstGuess, out: Path | None = None) -> tuple[list[TimedMessage], Onlooker]:
    """What is told of a recording."""
    told: list[TimedMessage] = []
    with Bag(bag) as recording:
        known, robot = build_robot(recording, WORLD, OPTIONS)
        messages = RunMessages(message_types("jazzy"), known, robot.lens, robot.mount, counts=False)
        onlooker = Onlooker(build_onlooker_head("bag", WORLD, robot, guess), out, told.extend, messages=messages)
        follow_bag(recording.items(), onlooker, recording.left_out)
        onlooker.close("the recording ends")
    assert not onlooker.scheduler.view.where(Difference, lambda d: d.is_of_sense)  # each sense is as it is told
    return told, onlooker


def check_poses(told: list[TimedMessage], truth: Truth, began_s: float) -> int:
    """Each certain pose is within three standard deviations of the truth; returns how many there are."""
    times, certain = np.array([time_s for time_s, _ in truth]), 0
    for item in told:
        if item.topic != "harvey/pose" or item.message.pose.covariance[0] >= 1e6:
            continue
        certain += 1
        there = truth[int(np.argmin(np.abs(times - began_s - item.time_s)))][1]
        at, turn, c = item.message.pose.pose.position, item.message.pose.pose.orientation, item.message.pose.covariance
        off = np.array([at.x - there.x_m, at.y - there.y_m])
        assert off @ np.linalg.solve(np.array([[c[0], c[1]], [c[6], c[7]]]), off) < 11.8, (item.time_s, off)
        assert abs(wrap_angle(2.0 * math.atan2(turn.z, turn.w) - there.heading_rad)) < 3.0 * math.sqrt(c[35])
    return certain


def _pursue(here: Pose2, points: list[tuple[float, float]]) -> tuple[float, float]:
    """Speed and rate toward the first point; one that is reached is taken off."""
    x, y = points[0]
    if math.hypot(x - here.x_m, y - here.y_m) < 0.15:
        points.pop(0)
        return 0.0, 0.0
    off = wrap_angle(math.atan2(y - here.y_m, x - here.x_m) - here.heading_rad)
    return (0.0 if abs(off) > 0.6 else 0.3), max(-0.6, min(0.6, 1.5 * off))
