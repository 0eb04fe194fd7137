"""Messages over Cyclone DDS: types made from the same definitions, bytes that come ready made."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from cyclonedds.core import (
    DDSException,
    InstanceState,
    Policy,
    Qos,
    ReadCondition,
    SampleState,
    ViewState,
    WaitSet,
)
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import make_idl_struct, types
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic as DdsTopic
from cyclonedds.util import duration
from rosbags.interfaces import Nodetype

from harvey_ros2.messages.messages import MessageTypes, dds_name
from harvey_ros2.messages.middleware import Delivery, Heard, Topic

ANY = ViewState.Any | SampleState.NotRead | InstanceState.Any
BASES = {"bool": bool, "string": str, "byte": types.uint8, "octet": types.uint8, "char": types.uint8}


class DdsMiddleware:
    """A participant of DDS, with the names and types that ROS 2 uses there."""

    def __init__(self, types: MessageTypes, node: str, *, domain: int = 0) -> None:
        """Join a domain; ``node`` is not told to others. Raises OSError where there is no network."""
        try:
            self._participant = DomainParticipant(domain)
        except DDSException as error:
            raise OSError(f"expected a network for Cyclone DDS, got: {error}") from None
        self._types, self._node = types, node
        self._lock = threading.Lock()
        self._idl: dict[str, type[Any]] = {}
        self._writers: dict[Topic, Any] = {}
        self._readers: list[tuple[Any, Callable[[Heard], None]]] = []
        self._waits, self._over = WaitSet(self._participant), threading.Event()
        self._thread = threading.Thread(target=self._run, name="dds", daemon=True)
        self._thread.start()

    def publish(self, topic: Topic, cdr: bytes) -> None:
        """Send a message. Raises OSError."""
        with self._lock:
            try:
                writer = self._writer(topic)
                writer.write(writer.data_type.of_bytes(cdr))
            except DDSException as error:
                raise OSError(f"{topic.name}: {error}") from None

    def subscribe(self, topic: Topic, heard: Callable[[Heard], None]) -> None:
        """Have each message of a topic handed over. Raises OSError."""
        with self._lock:
            try:
                reader: Any = DataReader(self._participant, self._topic(topic), qos=_qos(topic.delivery))
                self._waits.attach(ReadCondition(reader, ANY))
            except DDSException as error:
                raise OSError(f"{topic.name}: {error}") from None
            self._readers.append((reader, heard))

    def sender(self, topic: Topic) -> str:
        """How others see us as the publisher of a topic."""
        with self._lock:
            return str(self._writer(topic).get_guid())

    def close(self) -> None:
        """Leave the domain."""
        self._over.set()
        self._thread.join(2.0)
        with self._lock:
            self._readers.clear()
            self._writers.clear()

    def _run(self) -> None:
        """Hand over what comes. Cyclone's own listeners may be called before Python knows their reader."""
        while not self._over.is_set():
            self._waits.wait(duration(milliseconds=50))
            with self._lock:
                readers = list(self._readers)
            for reader, heard in readers:
                for sample in reader.take(N=64):
                    if hasattr(sample, "cdr"):
                        heard(Heard(sample.cdr, _sender_of(reader, sample), time.monotonic()))

    def _writer(self, topic: Topic) -> Any:
        if topic not in self._writers:
            self._writers[topic] = DataWriter(self._participant, self._topic(topic), qos=_qos(topic.delivery))
        return self._writers[topic]

    def _topic(self, topic: Topic) -> Any:
        return DdsTopic(self._participant, f"rt{topic.name}", self._class_of(topic.type))

    def _class_of(self, name: str) -> type[Any]:
        if name not in self._idl:
            self._idl[name] = build_passing_class(self._types, name)
        return self._idl[name]


def build_idl_class(types_of: MessageTypes, name: str, known: dict[str, type[Any]] | None = None) -> type[Any]:
    """The class of cyclonedds for a message type, made from its definition."""
    known = {} if known is None else known
    if name not in known:
        fields = {field: _hint(types_of, node, known) for field, node in types_of.store.fielddefs[name][1]}
        typename = dds_name(name).replace("::", ".")
        known[name] = make_idl_struct(f"{name.split('/')[-1]}_", typename, fields)
    return known[name]


def build_passing_class(types_of: MessageTypes, name: str) -> Any:
    """The same, but its samples are bytes on the way in and out: Python's cyclonedds takes 30 ms for a picture's."""
    made: Any = build_idl_class(types_of, name)

    def of_bytes(cdr: bytes) -> Any:
        sample = made.__new__(made)
        sample.cdr = cdr
        return sample

    made.of_bytes = staticmethod(of_bytes)
    made.serialize = lambda self, **_: self.cdr
    made.deserialize = staticmethod(lambda data, **_: of_bytes(bytes(data)))
    return made


def _hint(types_of: MessageTypes, node: Any, known: dict[str, type[Any]]) -> Any:
    kind, about = node
    if kind is Nodetype.NAME:
        return build_idl_class(types_of, about, known)
    if kind is Nodetype.BASE:
        return BASES.get(about[0]) or getattr(types, about[0])
    inner, size = about
    hint, made_of = _hint(types_of, inner, known), vars(types)
    return made_of["array"][hint, size] if kind is Nodetype.ARRAY else made_of["sequence"][hint]


def _qos(delivery: Delivery) -> Any:
    forever = duration(infinite=True)
    return Qos(
        Policy.Reliability.Reliable(duration(milliseconds=100)) if delivery.reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if delivery.kept else Policy.Durability.Volatile,
        Policy.History.KeepLast(delivery.depth), Policy.Lifespan(forever))


def _sender_of(reader: Any, sample: Any) -> str:
    try:
        return str(reader.get_matched_publication_data(sample.sample_info.publication_handle).key)
    except (DDSException, AttributeError):
        return ""  # it is gone by now
