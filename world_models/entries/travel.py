"""Where the robot should have come to by its headings, since a place that it knows: it tells where the camera looks."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from blackboard.kinds import inference
from world_models import words
from world_models.entries.location import Covariance, covariance_tuple
from world_models.frames import Pose2, wrap_angle


@inference()
@dataclass(frozen=True, slots=True)
class Travel:
    """The way since a place, as the believed headings and the wheels have it.

    Headings are the camera's direction less its believed yaw on the robot. Is that wrong, the robot drives aside of
    where it believes to head, and comes to the same distance in another direction.

    Attributes:
        began: pose at its begin, by a milestone or by tracks [world]; covariance: of it.
        x_m, y_m: where the wheels and the headings say that the robot is from there [world].
        gone_m: length of the way; pending_m: of its last motion, whose heading at the end was not seen yet.
        heading_rad: believed by the wheels after the last motion.
        slip_m2: variance of what the wheels slipped aside in turns.
        yaw_rad, yaw_variance: of the camera, as known when it began.
        is_broken: the robot was pushed, stopped or lost on it.
    """

    began: Pose2
    covariance: Covariance
    yaw_rad: float
    yaw_variance: float
    x_m: float = 0.0
    y_m: float = 0.0
    gone_m: float = 0.0
    pending_m: float = 0.0
    heading_rad: float = 0.0
    slip_m2: float = 0.0
    is_broken: bool = False

    def seen(self, heading_rad: float) -> Travel:
        """With the heading that was seen after the last motion: on an arc its way is half-way between both ends."""
        bent = 0.5 * wrap_angle(heading_rad - self.heading_rad) * self.pending_m
        return replace(self, x_m=self.x_m - bent * math.sin(heading_rad), y_m=self.y_m + bent * math.cos(heading_rad),
                       heading_rad=heading_rad, pending_m=0.0)

    def after_motion(self, before: Pose2, after: Pose2, slip_m: float) -> Travel:
        """After a motion that the wheels report, from a pose as it was seen to one as they say."""
        ahead = after.position - before.position
        seen, gone_m = self.seen(before.heading_rad), float(math.hypot(*ahead))
        return replace(seen, x_m=seen.x_m + float(ahead[0]), y_m=seen.y_m + float(ahead[1]),
                       gone_m=seen.gone_m + gone_m, pending_m=gone_m, heading_rad=after.heading_rad,
                       slip_m2=seen.slip_m2 + slip_m**2)

    def turned(self, turn_rad: float, forward_m: float) -> Travel:
        """The same way by headings that are all turned: the camera stays where it was, ``forward_m`` before the axis.
        """
        c, s = math.cos(turn_rad), math.sin(turn_rad)
        return replace(self, began=turn_about_camera(self.began, turn_rad, forward_m), x_m=c * self.x_m - s * self.y_m,
                       y_m=s * self.x_m + c * self.y_m, heading_rad=self.heading_rad + turn_rad)

    @property
    def net_m(self) -> float:
        """Distance from its begin."""
        return math.hypot(self.x_m, self.y_m)

    def sentence(self) -> str:
        return (f"{words.metres(self.gone_m)} of way, {words.metres(self.net_m)} from where it began, by the wheels and"
                " the headings")


def begin_travel(pose: Pose2, covariance: object, yaw_rad: float, yaw_variance: float) -> Travel:
    """A way that begins at a pose (world) with its covariance (3, 3)."""
    return Travel(pose, covariance_tuple(covariance), yaw_rad, yaw_variance, heading_rad=pose.heading_rad)


def turn_about_camera(pose: Pose2, turn_rad: float, forward_m: float) -> Pose2:
    """A robot's pose turned about its camera, which is ``forward_m`` before its axis."""
    camera = pose @ Pose2(forward_m, 0.0, turn_rad)
    return camera @ Pose2(-forward_m, 0.0, 0.0)
