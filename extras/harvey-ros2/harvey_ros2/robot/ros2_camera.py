"""A camera whose pictures come over ROS 2, as a source for :class:`harvey.hardware.drivers.video_camera.VideoCamera`.

A picture that was taken before it was asked for is left out: its stamp is compared with that of the newest odometry, as
both are by the robot's clock.
"""

from __future__ import annotations

import threading
from typing import Any

import cv2

from harvey.errors import BadInput
from harvey.hardware.drivers.capture import CameraFault, CameraKind
from harvey_ros2.messages.messages import MessageError, seconds
from harvey_ros2.messages.middleware import Heard
from harvey_ros2.robot.node import RosNode, open_node
from harvey_ros2.robot.picture_message import retrieve_picture

FIRST_S = 3.0
"""How long the first picture may take [s]."""
NEXT_S = 1.0
"""Without a picture for so long the camera is unplugged [s]."""


class RosCapture:
    """Pictures of one topic: what is used of ``cv2.VideoCapture``."""

    def __init__(self, node: RosNode) -> None:
        self._node, self._topic = node, node.robot.topic("picture")
        self._arrived = threading.Condition()
        self._newest: Heard | None = None
        self._taken: Any = None
        self._stamp_s = 0.0
        self._is_open = True
        node.look(self._take)

    def isOpened(self) -> bool:
        """Whether a picture comes in time; where none does, it is let go."""
        with self._arrived:
            came = self._arrived.wait_for(lambda: self._newest is not None, FIRST_S)
        if not came:
            self.release()
        return came

    def grab(self) -> bool:
        """Wait for the next picture that is taken from now on; whether one comes in time."""
        since_s = self._node.counted_s()
        with self._arrived:
            self._newest = None
            while self._is_open and self._arrived.wait_for(lambda: self._newest is not None, NEXT_S):
                heard, self._newest = self._newest, None
                if heard is None:
                    continue
                try:
                    message = self._node.types.decode(heard.cdr, self._topic.type)
                except MessageError:
                    continue
                self._taken, self._stamp_s = message, seconds(message.header.stamp)
                if self._stamp_s >= since_s:
                    return True
        return False

    def retrieve(self) -> tuple[bool, Any]:
        """Whether the picture is whole, and its JPEG bytes or pixels (h, w[, 3]), blue first."""
        message = self._taken
        if message is None:
            return False, None
        got = retrieve_picture(message)
        return (False, None) if isinstance(got, str) else (True, got)

    def get(self, property: int, /) -> float:
        """When the newest picture was taken [ms]; 0 for all else, and by a simulator's clock, which may be slow."""
        return 1000.0 * self._stamp_s if property == cv2.CAP_PROP_POS_MSEC and not self._node.robot.sim_time else 0.0

    def set(self, property: int, value: float, /) -> bool:
        """Nothing can be set."""
        return False

    def release(self) -> None:
        """No more pictures."""
        if self._is_open:
            self._is_open = False
            self._node.look(None)
            self._node.close()

    def _take(self, heard: Heard) -> None:
        with self._arrived:
            self._newest = heard
            self._arrived.notify_all()


def open_ros2_camera(where: str) -> RosCapture:
    """The camera of a robot over ROS 2. Raises CameraFault."""
    try:
        return RosCapture(open_node(where))
    except (OSError, BadInput) as error:
        raise CameraFault("unplugged", str(error)) from None


KIND = CameraKind("ros2", open_ros2_camera)
