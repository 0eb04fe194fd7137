"""A run as messages of ROS 2: what the robot saw, counted and believed, with the verdict on it.

A pose that no certificate vouches for is never told as certain: its covariance then says that it may be anywhere, and
the transform from map to odometry, by which others drive, is not published.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blackboard import Level
from harvey.runner.ports import STANDS_STILL
from harvey_ros2.messages.messages import MessageTypes, stamp
from harvey_ros2.messages.middleware import LATCHED, SENSOR, Delivery, Topic, full_name
from harvey_ros2.robot.robot_file import FrameNames
from knowledge_sources.reads.place_believed import MAX_P_RIVAL
from world_models.building.world import World
from world_models.camera import Camera, CameraMount
from world_models.entries import (
    ALERT_LIMIT_M,
    BodyFault,
    CameraPicture,
    Certificate,
    Difference,
    Discrepancy,
    Hypothesis,
    Milestone,
    MotionReport,
    PlanSketch,
)
from world_models.frames import Pose2

CAMERA_FRAME = "camera_optical"
PROTECTION = "protection level [m]"
UNKNOWN = 1e6
"""Variance of a pose that nothing vouches for [m^2, rad^2]."""
DOUBTFUL = 0.5
"""A picture by which the place is wrong with this probability ends the certainty until the next that verifies it."""
KINDS: tuple[type[Any], ...] = (
    MotionReport, CameraPicture, Hypothesis, Certificate, Milestone, PlanSketch, Discrepancy, Difference, BodyFault)
"""What is told of."""
OK, WARN, ERROR = 0, 1, 2
COLOURS: Mapping[str, tuple[float, float, float]] = {
    "expected": (1.0, 0.85, 0.0), "verified": (0.1, 0.8, 0.2), "refuted": (0.9, 0.1, 0.1)}
"""Of a milestone's lines, by its status."""
TYPES: Mapping[str, tuple[str, Delivery]] = {
    "/tf": ("tf2_msgs/msg/TFMessage", Delivery(depth=100)), "/tf_static": ("tf2_msgs/msg/TFMessage", LATCHED),
    "odom": ("nav_msgs/msg/Odometry", SENSOR),
    "camera/image_raw/compressed": ("sensor_msgs/msg/CompressedImage", SENSOR),
    "camera/camera_info": ("sensor_msgs/msg/CameraInfo", SENSOR),
    "harvey/pose": ("geometry_msgs/msg/PoseWithCovarianceStamped", Delivery()),
    "harvey/plan": ("nav_msgs/msg/Path", Delivery()),
    "harvey/landmarks": ("visualization_msgs/msg/MarkerArray", Delivery()),
    "/diagnostics": ("diagnostic_msgs/msg/DiagnosticArray", Delivery()),
}
"""Every topic, its type and its delivery."""
SENSED = ("odom", "camera/image_raw/compressed", "camera/camera_info", "/tf_static")
"""What the robot says itself, where there is one."""


class TimedMessage(NamedTuple):
    """A message for a topic (:data:`TYPES`), and when it holds [s, of the run]."""

    topic: str
    message: Any
    time_s: float


def topic_of(name: str, namespace: str = "") -> Topic:
    """One of these topics in full."""
    kind, delivery = TYPES[name]
    return Topic(full_name(name, namespace), kind, delivery)


class RunMessages:
    """Makes the messages of one run, entry by entry.

    Attributes:
        is_certified: whether a certificate vouches for the belief; lost: what it is lost by, or "".
        time_s: of the newest entry that has a time; epoch_s: of the robot's clock when the run's says 0.
        odometry: where the wheels have counted to be.
    """

    def __init__(self, types: MessageTypes, world: World, camera: Camera, mount: CameraMount,
                 frames: FrameNames = FrameNames(), *, counts: bool = True) -> None:  # noqa: B008
        """``counts``: whether the odometry is made from the wheels' reports; else who has it sets :attr:`odometry`."""
        self._counts = counts
        self._types, self._world, self._camera, self._mount, self._frames = types, world, camera, mount, frames
        self.odometry = Pose2(0.0, 0.0, 0.0)
        self.is_certified, self.lost, self.time_s, self.epoch_s = False, "", 0.0, 0.0
        self._reason = "nothing was verified yet"
        self._protection = dict[str, str]()
        self._doubts: dict[str, str] = {}

    def begin(self) -> Iterator[TimedMessage]:
        """What is said once: where the camera is."""
        camera = self._mount.camera_from_robot.inverse()
        yield self._out("/tf_static", transforms=[{
            "header": self._header(self._frames.base), "child_frame_id": CAMERA_FRAME,
            "transform": {"translation": _vector(camera.translation), "rotation": quaternion(camera.rotation)}}])

    def take(self, value: Any) -> Iterator[TimedMessage]:
        """The messages of an entry of one of :data:`KINDS`."""
        if isinstance(value, MotionReport):
            self.time_s = max(self.time_s, value.sim_time_s)
            if not self._counts:
                return
            self.odometry = self.odometry @ Pose2(0.0, 0.0, value.turn_rad) @ Pose2(value.move_m, 0.0, 0.0)
            yield self._tell_odometry(value.move_m, value.turn_rad, value.duration_s)
            yield self._transform(self._frames.odom, self._frames.base, self.odometry)
        elif isinstance(value, CameraPicture):
            stood = self._counts and value.sim_time_s > self.time_s  # since the last report
            self.time_s = max(self.time_s, value.sim_time_s)
            yield from self._tell_picture(value)
            if stood:
                yield self._tell_odometry()
        elif isinstance(value, Hypothesis) and value.is_held:
            yield from self._tell_protection(value)
            if self._counts:  # else who has the odometry tells the pose
                yield from self._tell_belief(value)
        elif isinstance(value, Certificate):
            yield from self._tell_verdict(value)
        elif isinstance(value, Discrepancy):
            yield from self._tell_doubt(value)
        elif isinstance(value, Milestone):
            yield from self._tell_milestone(value)
        elif isinstance(value, PlanSketch):
            yield from self._tell_plan(value)
        elif isinstance(value, Difference):
            is_misled = value.p_misled > MAX_P_RIVAL
            yield from self.doubt(value.about, f"{value.about} differs, {value.odds_in_words()}" if is_misled else "")
        elif isinstance(value, BodyFault) and value.what == STANDS_STILL:
            yield from self.doubt("camera", f"the {value.what}: {value.detail}" if value.is_open else "")

    def transform(self, believed: Pose2, counted: Pose2, height_m: float = 0.0) -> TimedMessage:
        """From map to odometry, by where the robot is in both."""
        return self._transform(self._frames.map, self._frames.odom, believed @ counted.inverse(), height_m)

    def pose(self, believed: Pose2, covariance: NDArray[np.float64], height_m: float = 0.0) -> TimedMessage:
        """The believed pose with its covariance (3, 3), or with none at all where nothing vouches for it."""
        full = np.zeros((6, 6))
        rows = np.array([0, 1, 5])
        full[np.ix_(rows, rows)] = covariance if self.is_certified else np.eye(3) * UNKNOWN
        return self._out("harvey/pose", header=self._header(self._frames.map), pose={
            "pose": {"position": {"x": believed.x_m, "y": believed.y_m, "z": height_m},
                     "orientation": _about_z(believed.heading_rad)}, "covariance": full.ravel()})

    @property
    def unsure(self) -> str:
        """Why nothing is certified, whatever single pictures say; "" where nothing speaks against it."""
        return "; ".join(self._doubts.values())

    def doubt(self, part: str, why: str) -> Iterator[TimedMessage]:
        """Tell that a part of the robot cannot be relied on, and by what; "" where that is over."""
        if why != self._doubts.get(part, ""):
            self._doubts = {**self._doubts, part: why} if why else {
                other: said for other, said in self._doubts.items() if other != part}
            self.is_certified = self.is_certified and not why
            yield self.diagnosis()

    def diagnosis(self) -> TimedMessage:
        """Whether it knows where it is, by what, and how far off it may be: the protection level of its place."""
        level, said = (ERROR, f"lost: {self.lost}") if self.lost else (
            (OK, "certified") if self.is_certified else (
                WARN, f"not certified: {self.unsure}" if self.unsure else "not certified"))
        stated = {"verdict": self._reason, **(self._protection if self.is_certified else {})}
        status = {"level": level, "name": "harvey: place", "message": said, "hardware_id": "harvey",
                  "values": [self._types.build("diagnostic_msgs/msg/KeyValue", key=key, value=value)
                             for key, value in stated.items()]}
        return self._out("/diagnostics", header=self._header(""), status=[status])

    def _transform(self, parent: str, child: str, there: Pose2, height_m: float = 0.0) -> TimedMessage:
        return self._out("/tf", transforms=[{
            "header": self._header(parent), "child_frame_id": child,
            "transform": {"translation": {"x": there.x_m, "y": there.y_m, "z": height_m},
                          "rotation": _about_z(there.heading_rad)}}])

    def _tell_odometry(self, move_m: float = 0.0, turn_rad: float = 0.0, duration_s: float = 0.0) -> TimedMessage:
        took_s = max(duration_s, 1e-3)
        here = self.odometry
        return self._out("odom", header=self._header(self._frames.odom), child_frame_id=self._frames.base, pose={
            "pose": {"position": {"x": here.x_m, "y": here.y_m}, "orientation": _about_z(here.heading_rad)}},
            twist={"twist": {"linear": {"x": move_m / took_s}, "angular": {"z": turn_rad / took_s}}})

    def _tell_picture(self, picture: CameraPicture) -> Iterator[TimedMessage]:
        header = self._header(CAMERA_FRAME, picture.sim_time_s)
        data = np.frombuffer(picture.jpeg, np.uint8)
        yield self._out("camera/image_raw/compressed", picture.sim_time_s, header=header, format="jpeg", data=data)
        c = self._camera
        lens = np.zeros(5) if c.distortion is None else np.asarray(c.distortion, float)
        yield self._out(
            "camera/camera_info", picture.sim_time_s, header=header, height=c.height, width=c.width,
            distortion_model="plumb_bob", d=lens, k=c.matrix.ravel(), r=np.eye(3).ravel(),
            p=np.hstack([c.matrix, np.zeros((3, 1))]).ravel())

    def _tell_protection(self, belief: Hypothesis) -> Iterator[TimedMessage]:
        """How far off a place may be that a picture has just vouched for."""
        self._protection = {PROTECTION: f"{belief.protection_m:.4f}",
                            "protection level [rad]": f"{belief.protection_rad:.5f}",
                            "alert limit [m]": f"{ALERT_LIMIT_M:g}"}
        if self.is_certified and belief.basis == "milestone":
            yield self.diagnosis()

    def _tell_belief(self, belief: Hypothesis) -> Iterator[TimedMessage]:
        there, height_m = belief.world_from_robot(self._world), self._world.floor_m(belief.locale)
        yield self.pose(there, belief.covariance_world(self._world), height_m)
        if self.is_certified:
            yield self.transform(there, self.odometry, height_m)

    def _tell_verdict(self, verdict: Certificate) -> Iterator[TimedMessage]:
        self._reason, self._protection = f"{verdict.verdict}: {verdict.reason}", {}
        vouched = self.is_certified and verdict.p_wrong < DOUBTFUL and verdict.verdict != "refuted"
        self.is_certified = (vouched or verdict.verdict == "verified") and not (self.lost or self._doubts)
        yield self.diagnosis()

    def _tell_doubt(self, doubt: Discrepancy) -> Iterator[TimedMessage]:
        if doubt.level is not Level.GOAL:
            return
        was_lost, self.lost = self.lost, doubt.what if doubt.is_open else ""
        self.is_certified = self.is_certified and not self.lost  # found again: until the next picture vouches for it
        self._reason = "found again" if was_lost and not self.lost else self._reason
        yield self.diagnosis()

    def _tell_milestone(self, milestone: Milestone) -> Iterator[TimedMessage]:
        colour = COLOURS.get(milestone.status)
        if colour is None or not milestone.expected:
            return
        points = [{"x": x, "y": y, "z": z} for line in milestone.expected for x, y, z in line]
        red, green, blue = colour
        yield self._out("harvey/landmarks", markers=[{
            "header": self._header(self._frames.map), "ns": "milestone", "type": 5, "scale": {"x": 0.02},
            "pose": {"orientation": {"w": 1.0}}, "color": {"r": red, "g": green, "b": blue, "a": 1.0},
            "points": points, "text": milestone.what}])

    def _tell_plan(self, sketch: PlanSketch) -> Iterator[TimedMessage]:
        if not sketch.is_active or sketch.current is None:
            return
        places = [sketch.current.origin, *(subgoal.destination for subgoal in sketch.subgoals[sketch.at:])]
        header = self._header(self._frames.map)
        poses = [(place.in_world(self._world), self._world.floor_m(place.locale)) for place in places]
        yield self._out("harvey/plan", header=header, poses=[
            {"header": header, "pose": {"position": {"x": at.x_m, "y": at.y_m, "z": height_m},
                                        "orientation": {"w": 1.0}}} for at, height_m in poses])

    def _header(self, frame: str, time_s: float | None = None) -> dict[str, Any]:
        return {"stamp": stamp(self.epoch_s + (self.time_s if time_s is None else time_s)), "frame_id": frame}

    def _out(self, topic: str, time_s: float | None = None, **fields: Any) -> TimedMessage:
        return TimedMessage(topic, self._types.build(TYPES[topic][0], **fields),
                            self.time_s if time_s is None else time_s)


def _vector(values: Any) -> dict[str, float]:
    return dict(zip("xyz", map(float, values), strict=True))


def _about_z(heading_rad: float) -> dict[str, float]:
    return {"z": math.sin(heading_rad / 2.0), "w": math.cos(heading_rad / 2.0)}


def quaternion(rotation: NDArray[np.float64]) -> dict[str, float]:
    """Of a rotation (3, 3)."""
    r = np.asarray(rotation, float)
    w = math.sqrt(max(0.0, 1.0 + r[0, 0] + r[1, 1] + r[2, 2])) / 2.0
    x, y, z = (math.copysign(math.sqrt(max(0.0, 1.0 + 2.0 * r[i, i] - np.trace(r))) / 2.0, r[j, k] - r[k, j])
               for i, j, k in ((0, 2, 1), (1, 0, 2), (2, 1, 0)))
    return {"x": x, "y": y, "z": z, "w": w}
