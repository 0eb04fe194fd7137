"""What is wanted of a middleware: to publish and to subscribe, in bytes, and to end; topics and their delivery."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True)
class Delivery:
    """How messages are delivered (QoS).

    Attributes:
        reliable: sent again until they arrive.
        kept: the last ones are given to who comes later (transient local).
        depth: how many wait at most.
    """

    reliable: bool = True
    kept: bool = False
    depth: int = 10


SENSOR = Delivery(reliable=False, depth=5)
"""As sensors send: what is lost is lost."""
LATCHED = Delivery(kept=True, depth=16)
"""What is said once, as ``tf_static``."""


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic.

    Attributes:
        name: full, as ``/robot/odom``.
        type: of its messages, as ``nav_msgs/msg/Odometry``.
    """

    name: str
    type: str
    delivery: Delivery = Delivery()


@dataclass(frozen=True, slots=True)
class Heard:
    """A message as it arrived.

    Attributes:
        cdr: its bytes.
        sender: who published it, as the middleware tells publishers apart.
        came_s: when, by ``time.monotonic()``.
    """

    cdr: bytes
    sender: str
    came_s: float


class Middleware(Protocol):
    """Carries messages. Every method raises OSError where that cannot be."""

    def publish(self, topic: Topic, cdr: bytes, /) -> None:
        """Send a message. May be called from any thread."""
        ...

    def subscribe(self, topic: Topic, heard: Callable[[Heard], None], /) -> None:
        """Have each message handed over as it comes, in a thread of the middleware; a call may not last long."""
        ...

    def sender(self, topic: Topic, /) -> str:
        """How others see us as the publisher of a topic."""
        ...

    def close(self) -> None:
        """Say goodbye. Never raises; a second call does nothing."""
        ...


def full_name(name: str, namespace: str) -> str:
    """A topic's name with the namespace before it, unless it begins with a slash."""
    if name.startswith("/"):
        return name
    return "/" + "/".join(part for part in (namespace.strip("/"), name) if part)
