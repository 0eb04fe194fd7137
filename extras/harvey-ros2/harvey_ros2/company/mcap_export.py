"""A run as one MCAP file, as rosbag2 writes it: for rerun, Foxglove, and every tool that reads bags."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import StoragePlugin, Writer

from harvey.errors import BadInput
from harvey_ros2.messages.messages import message_types
from harvey_ros2.messages.middleware import Delivery
from harvey_ros2.messages.run_messages import KINDS, RunMessages, TimedMessage, topic_of
from logs.export import RunExporter
from logs.pictures import open_pictures
from logs.records import is_a
from logs.run_directory import RunDirectory
from logs.run_head import RunHead
from logs.timeline import Timeline
from world_models.entries import CameraPicture

DISTRO = "jazzy"
EVER = QosTime(9223372036, 854775807)
"""No bound, as rosbag2 writes it."""
NAMES = frozenset(kind.__name__ for kind in KINDS)


def list_messages(run: RunDirectory) -> Iterator[TimedMessage]:
    """The messages of a run, in the order of its journal. Raises BadInput and RecordingError."""
    head, pictures = RunHead.read(run.path), open_pictures(run)
    world = head.load_world()
    robot = head.model(world)
    messages = RunMessages(message_types(DISTRO), world, robot.lens, robot.mount)
    yield from messages.begin()
    for decision in Timeline(run.journal).decisions():
        for record in (*decision.observed, *decision.made):
            if not record.is_gone and record.type in NAMES:
                yield from messages.take(_value(record, pictures))


def write_mcap(run: RunDirectory, out: Path) -> int:
    """Write a run; returns the number of messages. Raises BadInput and RecordingError."""
    try:
        with tempfile.TemporaryDirectory(dir=out.resolve().parent) as folder:
            bag = Path(folder) / "run"
            number = write_bag(list_messages(run), bag)
            os.replace(bag / "run.mcap", out)
    except OSError as error:
        raise BadInput(f"--mcap {out}: expected a file to write to, got: {error.strerror or error}") from None
    return number


def write_bag(messages: Iterator[TimedMessage], folder: Path) -> int:
    """Write messages as a bag of ROS 2, a folder that is not there yet; returns their number."""
    types, connections, number = message_types(DISTRO), dict[str, Any](), 0
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for item in messages:
            if item.topic not in connections:
                topic = topic_of(item.topic)
                connections[item.topic] = writer.add_connection(
                    topic.name, topic.type, typestore=types.store, offered_qos_profiles=_profiles(topic.delivery))
            writer.write(connections[item.topic], max(0, round(item.time_s * 1e9)), types.encode(item.message))
            number += 1
    return number


def _profiles(delivery: Delivery) -> list[Qos]:
    """How a topic is to be published again: what is said once is kept for who comes later, else tf2 never hears it."""
    if not delivery.kept:
        return []  # the default, which every subscriber can hear
    return [Qos(QosHistory.KEEP_LAST, delivery.depth, QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL,
                EVER, EVER, QosLiveliness.AUTOMATIC, EVER, False)]


def _value(record: Any, pictures: Any) -> Any:
    """The value of an entry; a picture with its bytes."""
    if not is_a(record, CameraPicture):
        return record.value
    fields = record.fields
    number = int(fields["number"])
    return CameraPicture(pictures[number], number, float(fields["sim_time_s"]), str(fields.get("purpose", "")))


MCAP = RunExporter(write_mcap)
