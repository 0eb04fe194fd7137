"""The robot as base and camera see it: what it says comes into one queue, and what it is told goes out.

Base and camera of one mission share a node, so that the base knows how old the newest picture is.
"""

from __future__ import annotations

import math
import struct
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

from harvey_ros2.messages.messages import MessageError, MessageTypes, seconds
from harvey_ros2.messages.middleware import Heard, Topic
from harvey_ros2.robot.odometry import LeastDelay
from harvey_ros2.robot.robot_file import RobotFile, read_robot

WAITING = 1000
"""RobotMessages that wait to be read, at most; older ones are forgotten."""
ECHO_S = 1.0
"""What we have said comes back to us within so long, if at all [s]."""


class RobotMessages(Protocol):
    """What a base speaks through. Every method raises OSError where it is gone.

    Attributes:
        types: of the messages.
    """

    types: MessageTypes

    def send(self, key: str, message: Any, /) -> None:
        """Publish a message on the topic with this key in ``[topics]``."""
        ...

    def receive(self, timeout_s: float, /) -> tuple[str, Heard] | None:
        """The oldest message that was not read yet, with its topic's key; None where none comes in time."""
        ...

    def is_ours(self, key: str, heard: Heard, /) -> bool:
        """Whether we sent a message ourselves."""
        ...

    def now(self) -> float:
        """The time [s] by which messages come."""
        ...

    def time_there(self) -> float:
        """The robot's clock, as far as it was heard [s]."""
        ...

    def picture_age_s(self) -> float | None:
        """How old the newest picture is; None where nobody has looked yet [s]."""
        ...

    def reopen(self) -> None: ...

    def close(self) -> None: ...


class RosNode:
    """A node that speaks with one robot: a :class:`RobotMessages`.

    Attributes:
        robot: how it speaks; closed: set when the node is gone.
    """

    def __init__(self, robot: RobotFile) -> None:
        """Open it, and listen to what a base says. Raises OSError and BadInput."""
        self.robot, self.types = robot, robot.types
        self._middleware, self.closed = robot.open(), threading.Event()
        self._arrived, self._waiting = threading.Condition(), deque[tuple[str, Heard]](maxlen=WAITING)
        self._heard_odometry: Heard | None = None
        self._picture_came_s: float | None = None
        self._picture_delay, self._said = LeastDelay(), deque[tuple[float, bytes]]()
        self._picture: Callable[[Heard], None] | None = None
        self._is_looking = False
        self._clock: Heard | None = None
        for key in ("odom", "cmd_vel", "hazards", "scan"):
            if getattr(robot.topics, key):
                self._middleware.subscribe(robot.topic(key), self._taking(key))
        if robot.sim_time:
            self._middleware.subscribe(Topic("/clock", "rosgraph_msgs/msg/Clock"), self._take_clock)

    def send(self, key: str, message: Any) -> None:
        """Publish on one of the robot's topics. Raises OSError."""
        cdr, now_s = self.types.encode(message), time.monotonic()
        while self._said and now_s - self._said[0][0] > ECHO_S:
            self._said.popleft()
        self._said.append((now_s, cdr))
        self._middleware.publish(self.robot.topic(key), cdr)

    def publish(self, topic: Topic, message: Any) -> None:
        """Publish on any topic. Raises OSError."""
        self._middleware.publish(topic, self.types.encode(message))

    def subscribe(self, topic: Topic, heard: Callable[[Heard], None]) -> None:
        """Listen to any topic. Raises OSError."""
        self._middleware.subscribe(topic, heard)

    def receive(self, timeout_s: float) -> tuple[str, Heard] | None:
        """The oldest message that was not read yet."""
        with self._arrived:
            if not self._waiting:
                self._arrived.wait_for(lambda: self._waiting, timeout_s)
            return self._waiting.popleft() if self._waiting else None

    def is_ours(self, key: str, heard: Heard) -> bool:
        """Whether we sent a message; one of nobody's name is ours if it says what we have said lately."""
        if heard.sender:
            return heard.sender == self._middleware.sender(self.robot.topic(key))
        return any(cdr == heard.cdr and heard.came_s - said_s <= ECHO_S for said_s, cdr in list(self._said))

    def now(self) -> float:
        return time.monotonic()

    def time_there(self) -> float:
        """The robot's clock: of a simulator, as it says; else ours, which ROS wants to be the same."""
        if not self.robot.sim_time:
            return time.time()
        clock = self._clock
        try:
            return 0.0 if clock is None else seconds(self.types.decode(clock.cdr, "rosgraph_msgs/msg/Clock").clock)
        except MessageError:
            return 0.0

    def counted(self) -> Any:
        """The newest odometry as a message; None where none was heard, or it is garbled."""
        heard = self._heard_odometry
        try:
            return None if heard is None else self.types.decode(heard.cdr, self.robot.topic("odom").type)
        except MessageError:
            return None

    def counted_s(self) -> float:
        """The stamp of the newest odometry [s]; 0 where none was heard."""
        message = self.counted()
        return 0.0 if message is None else seconds(message.header.stamp)

    @property
    def odometry_came_s(self) -> float | None:
        """When odometry last came, by ``time.monotonic()``; None where none has."""
        return None if self._heard_odometry is None else self._heard_odometry.came_s

    def look(self, picture: Callable[[Heard], None] | None) -> None:
        """Hand over pictures from now on; None: nobody looks for a while. Raises OSError.

        Their age counts from when somebody first looked: a camera that is given up, and looked for again, stays silent.
        """
        self._picture = picture
        if picture is not None and self._picture_came_s is None:
            self._picture_came_s = time.monotonic()
        if picture is not None and not self._is_looking:
            self._is_looking = True
            self._middleware.subscribe(self.robot.topic("picture"), self._take_picture)

    def picture_age_s(self) -> float | None:
        """How old the newest picture is: since it came, and by how much later than the quickest it came [s]."""
        came_s = self._picture_came_s
        return None if came_s is None else time.monotonic() - came_s + self._picture_delay.above_s

    @property
    def late_s(self) -> float:
        """Odometry that comes so much later than the quickest is stale [s]; a simulator's clock does not tell that."""
        return math.inf if self.robot.sim_time else self.robot.drive.fresh_s

    def reopen(self) -> None:
        """Nothing to do: a middleware finds its peers again by itself."""

    def close(self) -> None:
        """Let it go, if nobody else has it."""
        _let_go(self)

    def close_for_good(self) -> None:
        """Say goodbye."""
        self.closed.set()
        self._middleware.close()

    def _taking(self, key: str) -> Callable[[Heard], None]:
        def take(heard: Heard) -> None:
            if key == "odom":
                self._heard_odometry = heard
            with self._arrived:
                self._waiting.append((key, heard))
                self._arrived.notify_all()

        return take

    def _take_picture(self, heard: Heard) -> None:
        last_s, picture, self._picture_came_s = self._picture_came_s, self._picture, heard.came_s
        if last_s is not None and heard.came_s - last_s > self.robot.drive.pictures_s:
            self._picture_delay = LeastDelay()  # they stopped: their clock may have stood still with its process
        if not self.robot.sim_time and len(heard.cdr) >= 12:  # the stamp is what a message begins with
            sec, nanosec = struct.unpack_from("<iI" if heard.cdr[1] & 1 else ">iI", heard.cdr, 4)
            self._picture_delay.take(heard.came_s, sec + 1e-9 * nanosec)
        if picture is not None:
            picture(heard)

    def _take_clock(self, heard: Heard) -> None:
        self._clock = heard


_lock = threading.Lock()
_open: dict[str, tuple[RosNode, int]] = {}
"""The nodes of this process by what they were opened with, and how many have each."""


def open_node(where: str) -> RosNode:
    """The node for a robot (:func:`read_robot`), one for all who ask for it. Raises OSError and BadInput."""
    with _lock:
        node, users = _open.get(where) or (RosNode(read_robot(where)), 0)
        _open[where] = (node, users + 1)
        return node


def _let_go(node: RosNode) -> None:
    with _lock:
        for where, (known, users) in list(_open.items()):
            if known is node:
                _open[where] = (known, users - 1)
                if users > 1:
                    return
                del _open[where]
    node.close_for_good()
