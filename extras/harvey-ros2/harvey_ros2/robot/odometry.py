"""Odometry out of whatever comes: late, doubled, out of order, garbled, from two senders, by a clock that jumps.

What does no harm is passed over and counted. What could mislead is a fault.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

from harvey_ros2.messages.messages import MessageError, MessageTypes, seconds
from harvey_ros2.messages.middleware import Heard
from world_models.entries import Odometry
from world_models.frames import Pose2, wrap_angle

JUMP_S = 2.0
"""A clock that goes back by more, or ahead by so much more than time passed, has jumped; less is out of order [s]."""
MOST_SPEED_M_PER_S, MOST_SPEED_RAD_PER_S, MOST_JUMP_M, MOST_JUMP_RAD = 5.0, 8.0, 0.1, 0.2
"""Wheels that count more than so fast, and so far at once, have lost count."""
HASTE = 20.0
"""A simulator may run so many times as fast as we."""
SENDER_S = 1.0
"""Who was silent for so long is gone, and another may take over [s]."""


DRIFT = 1e-3
"""Two clocks go apart by less than such a part of the time."""


class LeastDelay:
    """How much later a message came than the quickest, by its stamp: two clocks are compared with themselves only.

    Attributes:
        above_s: of the newest message [s].
    """

    def __init__(self) -> None:
        self._least_s, self._last_s = math.inf, 0.0
        self.above_s = 0.0

    def take(self, came_s: float, stamp_s: float) -> float:
        """A message with its stamp; returns by how much it came later than the quickest [s]."""
        drifted_s = DRIFT * max(0.0, came_s - self._last_s)
        self._last_s = came_s
        self._least_s = min(came_s - stamp_s, self._least_s + drifted_s)
        self.above_s = came_s - stamp_s - self._least_s
        return self.above_s


class OdometryFault(Exception):
    """What could mislead, in words. The next message begins again."""


@dataclass(frozen=True, slots=True)
class Counted:
    """One reading.

    Attributes:
        odometry: where the wheels count that the robot is, by its own clock.
        speed_m_per_s, turn_rad_per_s: as it says.
        came_s: when the message came.
    """

    odometry: Odometry
    speed_m_per_s: float
    turn_rad_per_s: float
    came_s: float

    @property
    def is_standing(self) -> bool:
        return abs(self.speed_m_per_s) < 0.005 and abs(self.turn_rad_per_s) < 0.01


class OdometryReader:
    """Reads one robot's odometry.

    Attributes:
        passed_over: how many messages of each kind were: ``doubled``, ``out of order``, ``garbled``, ``late``.
    """

    def __init__(self, types: MessageTypes, late_s: float = math.inf) -> None:
        """``late_s``: what comes so much later than the quickest, by its stamp, tells nothing of now [s]."""
        self._types, self._late_s, self._delay = types, late_s, LeastDelay()
        self._last: Counted | None = None
        self._newest: Counted | None = None
        self._sender, self._begin = "", Pose2(0.0, 0.0, 0.0)
        self.passed_over: Counter[str] = Counter()

    def read(self, heard: Heard) -> Counted | None:
        """A reading; None where the message is passed over. Raises OdometryFault.

        A robot's process that began again counts from nothing: what it counts goes on from where the last one ended.
        """
        try:
            found = _read(self._types.decode(heard.cdr, "nav_msgs/msg/Odometry"), heard.came_s)
        except MessageError:
            found = None
        if found is None:
            self.passed_over["garbled"] += 1
            return None
        last, newest, is_other = self._last, self._newest, heard.sender != self._sender
        if newest is not None and is_other and heard.came_s - newest.came_s >= SENDER_S:
            self._begin = _pose(newest.odometry) @ _pose(found.odometry).inverse()
            last = None
        found = replace(found, odometry=_moved(self._begin, found.odometry))
        if last is None:
            self._last = self._newest = found
            self._sender, self._delay = heard.sender, LeastDelay()
            self._delay.take(found.came_s, found.odometry.time_s)
            return found
        if is_other:
            raise OdometryFault("two publish its odometry")
        return self._compare(last, found)

    @property
    def is_late(self) -> bool:
        """Whether the newest that was not passed over otherwise came too late."""
        return self._delay.above_s > self._late_s

    def forget(self) -> None:
        """Begin again with the next message."""
        self._last = None

    def _compare(self, last: Counted, found: Counted) -> Counted | None:
        later_s = found.odometry.time_s - last.odometry.time_s
        passed_s = found.came_s - last.came_s
        if -JUMP_S <= later_s <= 0.0:
            self.passed_over["doubled" if later_s == 0.0 else "out of order"] += 1
            return None
        self._last = self._newest = found
        if later_s < 0.0:
            raise OdometryFault(f"its clock went back by {-later_s:.1f} s")
        if later_s > JUMP_S + HASTE * passed_s:
            raise OdometryFault(f"its clock went ahead by {later_s:.1f} s in {passed_s:.2f} s")
        away_m = math.hypot(found.odometry.x_m - last.odometry.x_m, found.odometry.y_m - last.odometry.y_m)
        turned = abs(wrap_angle(found.odometry.heading_rad - last.odometry.heading_rad))
        most = MOST_JUMP_M + MOST_SPEED_M_PER_S * later_s, MOST_JUMP_RAD + MOST_SPEED_RAD_PER_S * later_s
        if away_m > most[0] or turned > most[1]:
            raise OdometryFault(f"its odometry jumped by {away_m:.2f} m and {math.degrees(turned):.0f} degrees")
        if passed_s > self._late_s:  # it was silent, and the link lost: its clock may have stood still with it
            self._delay = LeastDelay()
        self._delay.take(found.came_s, found.odometry.time_s)
        if self.is_late:
            self.passed_over["late"] += 1
            return None
        return found


def _pose(there: Odometry) -> Pose2:
    return Pose2(there.x_m, there.y_m, there.heading_rad)


def _moved(begin: Pose2, there: Odometry) -> Odometry:
    at = begin @ _pose(there)
    return replace(there, x_m=at.x_m, y_m=at.y_m, heading_rad=at.heading_rad)


def _read(message: Any, came_s: float) -> Counted | None:
    at, spin = message.pose.pose.position, message.pose.pose.orientation
    moving, turning = message.twist.twist.linear.x, message.twist.twist.angular.z
    values = (at.x, at.y, spin.x, spin.y, spin.z, spin.w, moving, turning)
    length = math.hypot(spin.x, spin.y, spin.z, spin.w)
    if not (all(map(math.isfinite, values)) and abs(length - 1.0) < 0.01 and max(abs(at.x), abs(at.y)) < 1e6):
        return None
    heading = math.atan2(2.0 * (spin.w * spin.z + spin.x * spin.y), 1.0 - 2.0 * (spin.y**2 + spin.z**2))
    odometry = Odometry(float(at.x), float(at.y), heading, seconds(message.header.stamp))
    return Counted(odometry, float(moving), float(turning), came_s)
