"""Messages of ROS 2: their types from the definitions that ``rosbags`` ships, and their bytes (CDR).

A message is an object of a class that is made from its definition: ``geometry_msgs/msg/Twist`` has ``linear.x``.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from functools import cache
from typing import Any, Literal, get_args

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

Distro = Literal["humble", "jazzy", "kilted"]
STORES: Mapping[str, Stores] = {
    "humble": Stores.ROS2_HUMBLE, "jazzy": Stores.ROS2_JAZZY, "kilted": Stores.ROS2_KILTED}
NO_HASH = "TypeHashNotSupported"
"""What stands in the place of a type's hash in Humble, which knows none."""
HAZARDS = "irobot_create_msgs/msg/HazardDetectionVector"
"""What a Create 3, the base of a TurtleBot 4, tells of its bumper."""
ADDED: Mapping[str, str] = {
    "irobot_create_msgs/msg/HazardDetection": """
        uint8 BACKUP_LIMIT=0
        uint8 BUMP=1
        uint8 CLIFF=2
        uint8 STALL=3
        uint8 WHEEL_DROP=4
        uint8 OBJECT_PROXIMITY=5
        std_msgs/Header header
        uint8 type
    """,
    HAZARDS: """
        std_msgs/Header header
        irobot_create_msgs/HazardDetection[] detections
    """,
}
"""Definitions that ``rosbags`` lacks."""


BAD = (SerdeError, ValueError, TypeError, OverflowError, IndexError, AttributeError, MemoryError, struct.error)
"""What rosbags raises where a value or bytes do not fit."""


@cache
def ros_one_store() -> Typestore:
    """The message types of ROS 1, with that of ``tf``, which rosbags lacks."""
    store = get_typestore(Stores.ROS1_NOETIC)
    for name in ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"):
        store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", name))
    return store


class MessageError(ValueError):
    """Bytes that are no message of the type that was expected: names the type."""


class MessageTypes:
    """The message types of one distribution of ROS 2.

    Attributes:
        distro: its name, as ``jazzy``.
        store: of rosbags.
    """

    def __init__(self, distro: str) -> None:
        """Raises ValueError where the distribution is unknown."""
        if distro not in STORES:
            raise ValueError(f"expected a distribution of ROS 2, one of {', '.join(get_args(Distro))}, got {distro!r}")
        self.distro, self.store = distro, get_typestore(STORES[distro])
        for name, text in ADDED.items():
            lines = "\n".join(line.strip() for line in text.strip().splitlines())
            self.store.register(get_types_from_msg(lines, name))

    def build(self, name: str, /, **fields: Any) -> Any:
        """A message of a type, ``pkg/msg/Type``; what is not given is zero or empty, and a mapping is a message within.

        Raises:
            ValueError: there is no such type, or it has no such field.
        """
        if name not in self.store.fielddefs:
            raise ValueError(f"expected a message type of ROS 2 {self.distro}, got {name!r}")
        known = dict(self.store.fielddefs[name][1])
        if unknown := [field for field in fields if field not in known]:
            raise ValueError(f"{name}: expected its fields {', '.join(known)}, got {unknown[0]!r}")
        kind: Any = self.store.types[name]
        return kind(**{field: self._value(node, fields.get(field)) for field, node in known.items()})

    def encode(self, message: Any) -> bytes:
        """The bytes of a message, with the header that says how they are coded. Raises MessageError."""
        try:
            return bytes(self.store.serialize_cdr(message, message.__msgtype__))
        except BAD as error:
            raise MessageError(f"{message.__msgtype__}: {error}") from None

    def decode(self, data: bytes, name: str) -> Any:
        """The message of a type in some bytes. Raises MessageError where they are none."""
        try:
            return self.store.deserialize_cdr(data, name)
        except BAD as error:
            raise MessageError(f"{name}: expected its bytes, got {len(data)} others: {error}") from None

    def hash_of(self, name: str) -> str:
        """The hash of a type, as keys of Zenoh have it."""
        return NO_HASH if self.distro == "humble" else self.store.hash_rihs01(name)

    def _value(self, node: Any, given: Any) -> Any:
        """A field's value: what was given, in the form that the type wants, or else its zero."""
        kind, about = node
        if kind is Nodetype.BASE:
            return given if given is not None else {"string": "", "bool": False}.get(about[0], 0)
        if kind is Nodetype.NAME:
            return self.build(about, **(given or {})) if given is None or isinstance(given, Mapping) else given
        (inner_kind, inner), size = about
        items = list(given) if given is not None else [None] * (size if kind is Nodetype.ARRAY else 0)
        if inner_kind is Nodetype.BASE and inner[0] != "string":
            source = given if isinstance(given, np.ndarray | bytes) else [item or 0 for item in items]
            number = inner[0].replace("byte", "uint8").replace("octet", "uint8").replace("char", "uint8")
            return (np.frombuffer(source, np.uint8) if isinstance(source, bytes) else
                    np.asarray(source, dtype=number))
        return [self._value((inner_kind, inner), item) for item in items]


@cache
def message_types(distro: str) -> MessageTypes:
    """The message types of a distribution; read once. Raises ValueError."""
    return MessageTypes(distro)


def dds_name(name: str) -> str:
    """A type's name on the wire: ``geometry_msgs::msg::dds_::Twist_``."""
    package, _, kind = name.split("/")
    return f"{package}::msg::dds_::{kind}_"


def seconds(stamp: Any) -> float:
    """A time of ROS [s]."""
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def stamp(time_s: float) -> dict[str, int]:
    """A time [s, not before 1970] as the fields of a time of ROS."""
    nanoseconds = max(0, round(time_s * 1e9))
    return {"sec": nanoseconds // 10**9 % 2**31, "nanosec": nanoseconds % 10**9}
