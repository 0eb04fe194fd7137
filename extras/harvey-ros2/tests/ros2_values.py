"""Random messages of any type, for the tests of bytes."""

from __future__ import annotations

import math
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype

from harvey_ros2.messages.messages import MessageTypes

USED = (
    "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped", "nav_msgs/msg/Odometry", "sensor_msgs/msg/Image",
    "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/CameraInfo", "sensor_msgs/msg/LaserScan",
    "sensor_msgs/msg/Range", "tf2_msgs/msg/TFMessage", "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped", "nav_msgs/msg/Path", "visualization_msgs/msg/MarkerArray",
    "diagnostic_msgs/msg/DiagnosticArray", "rosgraph_msgs/msg/Clock", "irobot_create_msgs/msg/HazardDetectionVector",
)
"""Every type of message that the extra sends or hears."""
LETTERS = "abc_/ äß€\u4e2d0"


def random_message(types: MessageTypes, name: str, rng: np.random.Generator) -> Any:
    """A message with random values in every field."""
    known = types.store.fielddefs[name][1]
    return types.store.types[name](**{field: _value(types, node, rng) for field, node in known})


def _value(types: MessageTypes, node: Any, rng: np.random.Generator) -> Any:
    kind, about = node
    if kind is Nodetype.NAME:
        return random_message(types, about, rng)
    if kind is Nodetype.BASE:
        return _base(about[0], rng)
    (inner_kind, inner), size = about
    number = size if kind is Nodetype.ARRAY else int(rng.integers(0, 4))
    if inner_kind is Nodetype.BASE and inner[0] != "string":
        return np.array([_base(inner[0], rng) for _ in range(number)], dtype=_dtype(inner[0]))
    return [_value(types, (inner_kind, inner), rng) for _ in range(number)]


def _dtype(name: str) -> str:
    return {"byte": "uint8", "octet": "uint8", "char": "uint8"}.get(name, name)


def _base(name: str, rng: np.random.Generator) -> Any:
    if name == "string":
        return "".join(rng.choice(list(LETTERS), int(rng.integers(0, 9))))
    if name == "bool":
        return bool(rng.integers(0, 2))
    if name.startswith("float"):
        value = float(rng.choice([0.0, -0.0, math.inf, math.pi, 1e-30, *rng.normal(size=4)]))
        return float(np.float32(value)) if name == "float32" else value
    if name == "byte":
        return int(rng.integers(0, 128))  # rosbags has them signed
    limits = np.iinfo(_dtype(name))
    return int(rng.integers(limits.min, limits.max, endpoint=True, dtype=_dtype(name)))


def plain(value: Any) -> Any:
    """A message of any library as dicts, lists and numbers, to compare what they read."""
    if is_dataclass(value):
        names = [field.name for field in fields(value) if field.name == field.name.lower() and field.name[:2] != "__"]
        return {name: plain(getattr(value, name)) for name in names}  # names in capitals are constants
    if isinstance(value, np.ndarray):
        return [plain(item) for item in value.tolist()]
    if isinstance(value, bytes | bytearray):
        return list(value)
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value
