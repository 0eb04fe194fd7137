"""The file that says how a robot speaks ROS 2: ``robot.toml``, named in a mission as ``ros2:robot.toml``."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from harvey.errors import BadInput
from harvey_ros2.messages.messages import HAZARDS, MessageTypes, message_types
from harvey_ros2.messages.middleware import SENSOR, Delivery, Middleware, Topic, full_name
from harvey_ros2.messages.zenoh_middleware import ZenohMiddleware
from world_models.files.toml.settings_reader import read_settings
from world_models.files.toml.source import Source, WorldError
from world_models.units import Bounded, bounded

SCAN = "sensor_msgs/msg/LaserScan"
PEERS = "peers"
"""The router of who needs none."""
NAME = re.compile(r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")
"""A topic's name."""


@dataclass(frozen=True, slots=True)
class TopicNames:
    """What the robot calls its topics; those without a slash in front are in its namespace.

    Attributes:
        cmd_vel: what its wheels listen to.
        odom: where its wheels count that it is.
        picture: its camera's pictures, compressed where the name ends in ``/compressed``.
        camera_info: calibration of the camera.
        hazards: of a Create 3: its bumper; not given where there is none.
        scan: of a laser scanner (LaserScan), where there is one.
        tf_static: transforms that do not change, as the camera's mount.
    """

    cmd_vel: str = "cmd_vel"
    odom: str = "odom"
    picture: str = "camera/image_raw/compressed"
    camera_info: str = "camera/camera_info"
    hazards: str = ""
    scan: str = ""
    tf_static: str = "/tf_static"

    def __post_init__(self) -> None:
        for key in self.__slots__:
            name = getattr(self, key)
            if not NAME.fullmatch(name) and (name or key not in ("hazards", "scan")):
                raise ValueError(f"expected {key} = the name of a topic, as camera/image_raw, got {name!r}")


@dataclass(frozen=True, slots=True)
class DriveSettings(Bounded):
    """How it is driven.

    Attributes:
        stamped: whether ``cmd_vel`` takes TwistStamped, not Twist.
        speed_m_per_s, turn_rad_per_s: fastest.
        fresh_s: odometry that is older stops it; pictures_s: so do pictures that are older.
    """

    stamped: bool = False
    speed_m_per_s: float = bounded(0.3, 0.02, 2.0)
    turn_rad_per_s: float = bounded(0.7, 0.05, 3.0)
    fresh_s: float = bounded(0.4, 0.05, 5.0)
    pictures_s: float = bounded(1.5, 0.1, 30.0)


@dataclass(frozen=True, slots=True)
class ScanMount(Bounded):
    """Where a laser scanner is on the robot.

    Attributes:
        forward_m, left_m: from the axis that the robot turns about.
        heading_rad: where its angle 0 faces, from the robot's heading, counter-clockwise.
    """

    forward_m: float = bounded(0.0, -2.0, 2.0)
    left_m: float = bounded(0.0, -2.0, 2.0)
    heading_rad: float = bounded(0.0, -math.pi, math.pi)


@dataclass(frozen=True, slots=True)
class FrameNames:
    """What frames are called: the building's, that of the odometry, the robot's."""

    map: str = "map"
    odom: str = "odom"
    base: str = "base_link"


@dataclass(frozen=True, slots=True)
class RobotFile(Bounded):
    """How a robot speaks ROS 2.

    Attributes:
        middleware: ``zenoh`` or ``cyclonedds``.
        router: of Zenoh, as ``tcp/127.0.0.1:7447``; ``peers`` to meet others of this network without one.
        domain: ROS_DOMAIN_ID.
        namespace: before the names of topics.
        distro: of ROS 2, for the types of its messages.
        sim_time: whether its clock is that of a simulator.
        node: our name there.
    """

    middleware: str = "zenoh"
    router: str = "tcp/127.0.0.1:7447"
    domain: int = bounded(0, 0, 232)
    namespace: str = ""
    distro: str = "jazzy"
    sim_time: bool = False
    node: str = "harvey"
    topics: TopicNames = field(default_factory=TopicNames)
    drive: DriveSettings = field(default_factory=DriveSettings)
    scan: ScanMount = field(default_factory=ScanMount)
    frames: FrameNames = field(default_factory=FrameNames)

    def __post_init__(self) -> None:
        Bounded.__post_init__(self)
        if self.middleware not in ("zenoh", "cyclonedds"):
            raise ValueError(f"expected middleware = zenoh or cyclonedds, got {self.middleware!r}")
        if self.namespace and not NAME.fullmatch(self.namespace):
            raise ValueError(f"expected a namespace as robot_1, got {self.namespace!r}")
        message_types(self.distro)

    @property
    def types(self) -> MessageTypes:
        """Of its messages."""
        return message_types(self.distro)

    def topic(self, key: str) -> Topic:
        """A topic of the robot by its key in ``[topics]``."""
        name = getattr(self.topics, key)
        kinds = {
            "cmd_vel": "geometry_msgs/msg/TwistStamped" if self.drive.stamped else "geometry_msgs/msg/Twist",
            "odom": "nav_msgs/msg/Odometry",
            "picture": f"sensor_msgs/msg/{'CompressedImage' if name.endswith('/compressed') else 'Image'}",
            "camera_info": "sensor_msgs/msg/CameraInfo", "hazards": HAZARDS, "scan": SCAN,
            "tf_static": "tf2_msgs/msg/TFMessage",
        }
        delivery = {"cmd_vel": Delivery(), "tf_static": Delivery(kept=True, depth=100)}.get(key, SENSOR)
        return Topic(full_name(name, self.namespace), kinds[key], delivery)

    def other(self, name: str, kind: str, delivery: Delivery = Delivery()) -> Topic:  # noqa: B008
        """A topic that is not the robot's own."""
        return Topic(full_name(name, self.namespace), kind, delivery)

    def open(self) -> Middleware:
        """A node. Raises OSError, and BadInput where its middleware is not installed."""
        if self.middleware == "zenoh":
            return ZenohMiddleware(self.types, self.node, domain=self.domain,
                                   router="" if self.router == PEERS else self.router)
        try:
            from harvey_ros2.messages.dds_middleware import DdsMiddleware
        except ImportError:
            raise BadInput("middleware = \"cyclonedds\" needs cyclonedds: pip install './extras/harvey-ros2[dds]'"
                           ) from None
        return DdsMiddleware(self.types, self.node, domain=self.domain)


def read_robot(where: str) -> RobotFile:
    """A robot by its file or, where no file is meant, by the address of a router: ``tcp/127.0.0.1:7447``.

    Raises:
        BadInput: names file, line, what was expected and what came.
    """
    try:
        if where.endswith(".toml"):
            return read_settings(Source.read(Path(where)).root, RobotFile)
        data: dict[str, Any] = {"router": where}
        return read_settings(Source("ros2", data).root, RobotFile)
    except (WorldError, ValueError) as error:
        raise BadInput(str(error)) from None
