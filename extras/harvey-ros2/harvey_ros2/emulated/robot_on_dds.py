"""The emulated robot over Cyclone DDS: its own definitions of the messages. No code of the driver."""

from __future__ import annotations

import threading
from functools import cache
from typing import TYPE_CHECKING, Any

from cyclonedds.core import DDSException, Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import make_idl_struct, types
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from harvey.errors import BadInput

if TYPE_CHECKING:
    from harvey_ros2.emulated.robot_server import Hear, Meeting

LISTEN_S = 0.005
DEFINITIONS = """
builtin_interfaces.Time        int32 sec, uint32 nanosec
std_msgs.Header                Time stamp, string frame_id
geometry_msgs.Vector3          float64 x, float64 y, float64 z
geometry_msgs.Point            float64 x, float64 y, float64 z
geometry_msgs.Quaternion       float64 x, float64 y, float64 z, float64 w
geometry_msgs.Twist            Vector3 linear, Vector3 angular
geometry_msgs.TwistStamped     Header header, Twist twist
geometry_msgs.Pose             Point position, Quaternion orientation
geometry_msgs.PoseWithCovariance   Pose pose, float64[36] covariance
geometry_msgs.TwistWithCovariance  Twist twist, float64[36] covariance
geometry_msgs.Transform        Vector3 translation, Quaternion rotation
geometry_msgs.TransformStamped Header header, string child_frame_id, Transform transform
nav_msgs.Odometry              Header header, string child_frame_id, PoseWithCovariance pose, TwistWithCovariance twist
sensor_msgs.CompressedImage    Header header, string format, uint8[] data
sensor_msgs.RegionOfInterest   uint32 x_offset, uint32 y_offset, uint32 height, uint32 width, bool do_rectify
sensor_msgs.CameraInfo         Header header, uint32 height, uint32 width, string distortion_model, float64[] d, \
float64[9] k, float64[9] r, float64[12] p, uint32 binning_x, uint32 binning_y, RegionOfInterest roi
tf2_msgs.TFMessage             TransformStamped[] transforms
irobot_create_msgs.HazardDetection        Header header, uint8 type
irobot_create_msgs.HazardDetectionVector  Header header, HazardDetection[] detections
rosgraph_msgs.Clock            Time clock
"""
"""What the robot says and hears, by the documentation of ROS 2."""
TOPICS = {"odom": "Odometry", "camera/image_raw/compressed": "CompressedImage", "camera/camera_info": "CameraInfo",
          "tf_static": "TFMessage", "hazards": "HazardDetectionVector", "clock": "Clock"}
COMMANDS = {"cmd_vel": "Twist", "cmd_vel_stamped": "TwistStamped"}
SENSOR = Qos(Policy.Reliability.BestEffort, Policy.Durability.Volatile, Policy.History.KeepLast(5))
LATCHED = Qos(Policy.Reliability.Reliable(duration(milliseconds=100)), Policy.Durability.TransientLocal,
              Policy.History.KeepLast(1))


@cache
def build_types() -> dict[str, Any]:
    """A class of cyclonedds for each of :data:`DEFINITIONS`, whose samples are the bytes of a message."""
    made: dict[str, Any] = {}

    def hint(text: str) -> Any:
        kind, _, size = text.removesuffix("]").partition("[")
        inner = made.get(kind) or {"string": str, "bool": bool}.get(kind) or getattr(types, kind)
        if "[" not in text:
            return inner
        generic = vars(types)["array" if size else "sequence"]
        return generic[inner, int(size)] if size else generic[inner]

    for line in DEFINITIONS.strip().splitlines():
        name, _, fields = line.partition(" ")
        package, _, kind = name.partition(".")
        pairs = (field.split() for field in fields.split(","))
        made[kind] = make_idl_struct(f"{kind}_", f"{package}.msg.dds_.{kind}_",
                                     {field: hint(text) for text, field in pairs})
    for kind in (*TOPICS.values(), *COMMANDS.values()):
        made[kind].serialize = lambda self, **_: self.cdr
        made[kind].deserialize = classmethod(_of_bytes)
    return made


def _of_bytes(cls: Any, data: bytes, /, **_: Any) -> Any:
    sample = cls.__new__(cls)
    sample.cdr = bytes(data)
    return sample


class DdsNetwork:
    """A participant with the robot's topics: a :class:`harvey_ros2.emulated.robot_server.RobotNetwork`."""

    def __init__(self, meeting: Meeting) -> None:
        """Join the domain. Raises BadInput where there is no network."""
        try:
            self._participants = DomainParticipant(meeting.domain), DomainParticipant(meeting.domain)
        except DDSException as error:
            raise BadInput(f"--at: expected a network for {meeting.where}, got: {error}") from None
        self._meeting, self._lock = meeting, threading.Lock()
        self._over, self._thread = threading.Event(), threading.Thread()
        self._writers = {name: DataWriter(self._participants[0], self._topic(0, name, kind),
                                          qos=LATCHED if name == "tf_static" else SENSOR)
                         for name, kind in TOPICS.items()}

    def publish(self, name: str, cdr: bytes) -> None:
        """Send a message."""
        with self._lock:
            self._writers[name].write(_of_bytes(build_types()[TOPICS[name]], cdr))

    def listen(self, hear: Hear) -> None:
        """Hand over commands; each of the two types has a participant of its own, as a topic has one type in each."""
        readers = {key: DataReader(self._participants[number], self._topic(number, "cmd_vel", kind),
                                   qos=Qos(Policy.Reliability.Reliable(duration(milliseconds=100)),
                                           Policy.History.KeepLast(10)))
                   for number, (key, kind) in enumerate(COMMANDS.items())}

        def run() -> None:
            while not self._over.wait(LISTEN_S):
                for key, reader in readers.items():
                    for sample in reader.take(N=64):
                        if hasattr(sample, "cdr"):  # else it says that a publisher is gone
                            hear(key, sample.cdr)

        self._thread = threading.Thread(target=run, name="dds", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Leave the domain."""
        self._over.set()
        if self._thread.is_alive():
            self._thread.join(2.0)

    def _topic(self, number: int, name: str, kind: str) -> Any:
        return Topic(self._participants[number], f"rt/{self._meeting.full_name(name)}", build_types()[kind])
