"""What others of a ROS 2 network see of a run, and how they send the robot elsewhere.

The transform from map to odometry is said again ten times a second, with the stamp of that moment, as long as a
certificate vouches for it: all that Nav2 wants of a localizer.
"""

from __future__ import annotations

import math
import sys
import threading
from collections.abc import Iterable
from typing import Any

from blackboard import Decision, Scheduler
from harvey.runner.teller import LiveTeller
from harvey_ros2.messages.messages import MessageError
from harvey_ros2.messages.middleware import Heard
from harvey_ros2.messages.run_messages import KINDS, SENSED, RunMessages, TimedMessage, topic_of
from harvey_ros2.robot.node import RosNode
from world_models.building.world import World
from world_models.frames import Pose2, flattened
from world_models.robot import RobotModel
from world_models.units import FOOT_M

POSE = "geometry_msgs/msg/PoseStamped"
FIRST_POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
AGAIN_S = 0.1


class RosCompany:
    """Publishes a run for others.

    Attributes:
        messages: what is said of the run.
        first_pose: where somebody says that the robot is (``initialpose``), in the map; None where nobody did.
    """

    def __init__(self, node: RosNode, world: World, robot: RobotModel) -> None:
        """Begin; raises OSError."""
        self._node, self._world, self._teller = node, world, LiveTeller()
        self.messages = RunMessages(node.types, world, robot.lens, robot.mount, node.robot.frames, counts=False)
        self.first_pose: Pose2 | None = None
        self._transform: tuple[Pose2, Pose2] | None = None
        self._lock = threading.Lock()
        node.subscribe(node.robot.other("goal_pose", POSE), self._take_goal)
        node.subscribe(node.robot.other("initialpose", FIRST_POSE), self._take_first_pose)
        threading.Thread(target=self._say_again, name="transform", daemon=True).start()

    def hear(self, decision: Decision) -> None:
        """Publish what a decision changed."""
        with self._lock:
            self.messages.epoch_s, self.messages.time_s = self._node.time_there(), 0.0
            counted = read_odometry(self._node.counted())
            if counted is not None:
                self.messages.odometry = counted
            for change in (*decision.observed, *decision.made):
                value: Any = change.entry.value
                if isinstance(value, KINDS):
                    self._publish(item for item in self.messages.take(value) if item.topic not in SENSED)
                    self.messages.time_s = 0.0
                    self._place(value)

    def tell(self, scheduler: Scheduler) -> None:
        """Hand over goals."""
        self._teller.tell(scheduler)

    def publish(self, messages: Iterable[TimedMessage]) -> None:
        """Publish messages that somebody else made."""
        with self._lock:
            self._publish(messages)

    def place(self, believed: Pose2 | None, counted: Pose2) -> None:
        """Where the robot is in the map and by its wheels; None: nothing vouches for it."""
        with self._lock:
            self._transform = None if believed is None else (believed, counted)

    def _place(self, value: Any) -> None:
        if getattr(value, "is_held", False):
            there = value.world_from_robot(self._world)
            self._publish([self.messages.pose(there, value.covariance_world(self._world))])
            self._transform = (there, self.messages.odometry)
        if not self.messages.is_certified:
            self._transform = None

    def _say_again(self) -> None:
        """Until the node is closed."""
        while not self._node.closed.wait(AGAIN_S):
            with self._lock:
                if self._transform is None:
                    continue
                before = self.messages.epoch_s, self.messages.time_s
                self.messages.epoch_s, self.messages.time_s = self._node.time_there(), 0.0
                item = self.messages.transform(*self._transform)
                self.messages.epoch_s, self.messages.time_s = before
                self._publish([item])

    def _publish(self, messages: Iterable[TimedMessage]) -> None:
        for item in messages:
            try:
                self._node.publish(topic_of(item.topic, self._node.robot.namespace), item.message)
            except (OSError, MessageError):
                continue  # who cannot hear it now gets the next

    def _take_goal(self, heard: Heard) -> None:
        try:
            message = self._node.types.decode(heard.cdr, POSE)
            self._teller.hear(describe_place(self._world, self._in_map(message.header, message.pose)))
        except (MessageError, ValueError) as error:
            print(f"goal_pose: {error}", file=sys.stderr, flush=True)

    def _take_first_pose(self, heard: Heard) -> None:
        try:
            message = self._node.types.decode(heard.cdr, FIRST_POSE)
            there = self._in_map(message.header, message.pose.pose)
            describe_place(self._world, there)
            self.first_pose = there
        except (MessageError, ValueError) as error:
            print(f"initialpose: {error}", file=sys.stderr, flush=True)

    def _in_map(self, header: Any, pose: Any) -> Pose2:
        wanted = self._node.robot.frames.map
        if header.frame_id.lstrip("/") != wanted:
            raise ValueError(f"expected a pose in the frame {wanted}, got one in {header.frame_id!r}")
        turn = pose.orientation
        values = (pose.position.x, pose.position.y, turn.x, turn.y, turn.z, turn.w)
        if not all(map(math.isfinite, values)):
            raise ValueError("expected a pose, got one that is not finite")
        return Pose2(pose.position.x, pose.position.y, math.atan2(
            2.0 * (turn.w * turn.z + turn.x * turn.y), 1.0 - 2.0 * (turn.y**2 + turn.z**2)))


def describe_place(world: World, there: Pose2) -> str:
    """A place of the map as a goal: ``(hallway (4,4,0))``, in feet. Raises ValueError where there is no room."""
    locale = world.locale_at([there.x_m, there.y_m, 0.0])
    if locale is None or not world.is_room(locale):
        raise ValueError(f"expected a place within a room, got ({there.x_m:.2f}, {there.y_m:.2f}) m")
    own = flattened(world.world_from_locale(locale)).inverse() @ there
    return f"({locale} ({own.x_m / FOOT_M:.6f},{own.y_m / FOOT_M:.6f},0))"


def read_odometry(message: Any) -> Pose2 | None:
    """Where the wheels count to be, by a message; None where it is none."""
    if message is None:
        return None
    at, turn = message.pose.pose.position, message.pose.pose.orientation
    if not abs(math.hypot(turn.x, turn.y, turn.z, turn.w) - 1.0) < 0.01:  # zeros are no turn
        return None
    heading = math.atan2(2.0 * (turn.w * turn.z + turn.x * turn.y), 1.0 - 2.0 * (turn.y**2 + turn.z**2))
    return Pose2(at.x, at.y, heading) if math.isfinite(at.x + at.y + heading) else None
