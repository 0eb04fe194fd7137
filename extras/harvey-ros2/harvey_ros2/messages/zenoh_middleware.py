"""Messages over Zenoh, as ``rmw_zenoh`` of ROS 2 sends them: keys, attachments, and tokens that name node and topics.

Without tokens messages flow all the same, but ``ros2 topic list`` does not show us. A router passes nothing between
plain peers, so with a router we are its client.
"""

from __future__ import annotations

import hashlib
import json
import struct
import threading
import time
from collections.abc import Callable
from itertools import count
from typing import Any

import zenoh
import zenoh.ext

from harvey_ros2.messages.messages import MessageTypes, dds_name
from harvey_ros2.messages.middleware import Delivery, Heard, Topic

SENDER = struct.Struct("<qqB16s")
"""What goes with each message: its number, when it was sent [ns], the length of the sender's name, and that name."""


class ZenohMiddleware:
    """A node of ROS 2 over Zenoh."""

    def __init__(self, types: MessageTypes, node: str, *, domain: int = 0, router: str = "") -> None:
        """Open a session.

        Args:
            node: our name in the graph.
            router: where a router listens, as ``tcp/127.0.0.1:7447``; "" to meet peers of this network.

        Raises:
            OSError: there is no router, or the address is none.
        """
        zenoh.init_log_from_env_or("off")
        self._types, self._node, self._domain = types, node, domain
        try:
            self._session = zenoh.open(_build_config(router))
        except zenoh.ZError as error:
            where = f"a Zenoh router at {router}" if router else "a network for Zenoh"
            raise OSError(f"expected {where}, got: {_first_line(error)}") from None
        self._lock, self._ids = threading.Lock(), count(1)
        self._publishers: dict[Topic, _Publisher] = {}
        self._kept: list[Any] = [self._declare_token(f"{self._token_head(0)}/NN/%/%/{node}")]
        self._is_open = True

    def publish(self, topic: Topic, cdr: bytes) -> None:
        """Send a message. Raises OSError."""
        with self._lock:
            try:
                self._publisher(topic).put(cdr)
            except zenoh.ZError as error:
                raise OSError(f"{topic.name}: {_first_line(error)}") from None

    def subscribe(self, topic: Topic, heard: Callable[[Heard], None]) -> None:
        """Have each message of a topic handed over, whatever hash of its type the sender has. Raises OSError."""
        def take(sample: Any) -> None:
            if sample.kind == zenoh.SampleKind.PUT:
                heard(Heard(sample.payload.to_bytes(), _sender_of(sample), time.monotonic()))

        key = f"{self._domain}{topic.name}/{dds_name(topic.type)}/*"
        with self._lock:
            self._kept.append(self._declare_token(self._token(topic, "MS")))
            if topic.delivery.kept:
                history = zenoh.ext.HistoryConfig(detect_late_publishers=True)
                self._kept.append(zenoh.ext.declare_advanced_subscriber(self._session, key, take, history=history))
            else:
                self._kept.append(self._session.declare_subscriber(key, take))

    def sender(self, topic: Topic) -> str:
        """How others see us as the publisher of a topic."""
        with self._lock:
            return self._publisher(topic).name.hex()

    def close(self) -> None:
        """Say goodbye."""
        if self._is_open:
            self._is_open = False
            close: Callable[[], None] = self._session.close
            close()

    def _publisher(self, topic: Topic) -> _Publisher:
        if topic not in self._publishers:
            key = f"{self._domain}{topic.name}/{dds_name(topic.type)}/{self._types.hash_of(topic.type)}"
            token = self._token(topic, "MP")
            self._publishers[topic] = _Publisher(self._session, key, topic.delivery, token)
            self._kept.append(self._declare_token(token))
        return self._publishers[topic]

    def _token_head(self, entity: int) -> str:
        return f"@ros2_lv/{self._domain}/{self._session.zid()}/0/{entity}"

    def _token(self, topic: Topic, kind: str) -> str:
        name = topic.name.replace("/", "%")
        about = f"{dds_name(topic.type)}/{self._types.hash_of(topic.type)}/{_delivery_text(topic.delivery)}"
        return f"{self._token_head(next(self._ids))}/{kind}/%/%/{self._node}/{name}/{about}"

    def _declare_token(self, token: str) -> Any:
        return self._session.liveliness().declare_token(token)


class _Publisher:
    """One publisher; others tell it from the rest by its name, 16 bytes."""

    def __init__(self, session: Any, key: str, delivery: Delivery, token: str) -> None:
        self.name = hashlib.blake2b(token.encode(), digest_size=16).digest()
        self._numbers = count(1)
        if delivery.kept:
            cache = zenoh.ext.CacheConfig(delivery.depth)
            self._out: Any = zenoh.ext.declare_advanced_publisher(session, key, cache=cache, publisher_detection=True)
        else:
            self._out = session.declare_publisher(key)

    def put(self, cdr: bytes) -> None:
        self._out.put(cdr, attachment=SENDER.pack(next(self._numbers), time.time_ns(), 16, self.name))


def _build_config(router: str) -> Any:
    config = zenoh.Config()
    config.insert_json5("mode", json.dumps("client" if router else "peer"))
    config.insert_json5("timestamping/enabled", "true")  # what is kept for who comes later needs it
    if router:
        config.insert_json5("connect/endpoints", json.dumps([router]))
        config.insert_json5("scouting/multicast/enabled", "false")
    return config


def _delivery_text(delivery: Delivery) -> str:
    """Reliability, durability, history; the rest is as ``rmw_zenoh`` has it by itself. All fields have to be there."""
    return f"{'' if delivery.reliable else 2}:{1 if delivery.kept else ''}:,{delivery.depth}:,:,:,,"


def _sender_of(sample: Any) -> str:
    attached = b"" if sample.attachment is None else sample.attachment.to_bytes()
    return attached[17:33].hex() if len(attached) >= SENDER.size else ""


def _first_line(error: Exception) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__
