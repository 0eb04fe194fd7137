"""Localizer mode beside who drives, as Nav2: odometry and pictures of the network come to the onlooker as of a bag."""

from __future__ import annotations

import queue
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from harvey_ros2.company.ros2_company import RosCompany, describe_place
from harvey_ros2.following.follow_command import pair_with_odometry
from harvey_ros2.following.onlooker import FirstGuess, Onlooker, build_onlooker_head
from harvey_ros2.messages.messages import MessageError
from harvey_ros2.messages.middleware import Heard
from harvey_ros2.messages.run_messages import TimedMessage
from harvey_ros2.recordings.bag_reader import BagItem, read_picture_message
from harvey_ros2.robot.node import RosNode, open_node
from harvey_ros2.robot.odometry import OdometryFault, OdometryReader
from world_models.building.world import World
from world_models.frames import Pose2, flattened
from world_models.robot import RobotModel

Tell = Callable[[Iterable[TimedMessage]], None]
SIGMA_M, SIGMA_RAD = 0.3, 0.2
"""Of what somebody points out on a map."""
SILENT_S = 1.0


def follow_robot(
    where: str, world: Path, known: World, robot: RobotModel, guess: FirstGuess, out: Path, hear: Tell
) -> Onlooker:
    """Follow a robot until interrupted; returns who did. Raises OSError and BadInput.

    Args:
        where: the robot's file, or the address of a router.
        hear: gets what is published too.
    """
    node = open_node(where)
    try:
        company = RosCompany(node, known, robot)
        onlooker = _begin(company, world, robot, guess, out, hear)

        def fall_silent(why: str) -> None:
            """What others drive by is withdrawn while a sense is silent, and comes back with it."""
            told = list(company.messages.doubt("senses", why))
            if told:
                company.publish(told)
                hear(told)
                company.place(None, company.messages.odometry)

        stream = _Stream(node, fall_silent)
        try:
            last: Pose2 | None = None
            for time_s, counted, jpeg in pair_with_odometry(stream.items()):
                if company.first_pose is not None:
                    onlooker.close("somebody said where it is, and it begins again")
                    there, company.first_pose = company.first_pose, None
                    out = _next(out)
                    onlooker = _begin(company, world, robot, _to_guess(known, there), out, hear)
                    last, stream.began_s = None, None
                if stream.began_s is None:
                    stream.began_s = company.messages.epoch_s = time_s
                onlooker.heard_s = time_s - stream.began_s
                if last is not None:
                    onlooker.move(last.inverse() @ counted, onlooker.heard_s)
                last = company.messages.odometry = counted
                onlooker.pass_by(onlooker.heard_s)
                if stream.is_newest(time_s) and onlooker.wants(onlooker.heard_s):
                    onlooker.look(jpeg, onlooker.heard_s)
                    believed, _ = onlooker.belief()
                    company.place(believed if company.messages.is_certified else None, counted)
        except KeyboardInterrupt:
            pass
        onlooker.close("it was interrupted")
        return onlooker
    finally:
        node.close()


def _begin(company: RosCompany, world: Path, robot: RobotModel, guess: FirstGuess, out: Path, hear: Tell) -> Onlooker:
    def tell(messages: Iterable[TimedMessage]) -> None:
        told = list(messages)
        company.publish(told)
        hear(told)

    company.messages.is_certified, company.messages.lost, company.messages.time_s = False, "", 0.0
    return Onlooker(build_onlooker_head("robot", world, robot, guess), out, tell, messages=company.messages)


def _to_guess(world: World, there: Pose2) -> FirstGuess:
    place = describe_place(world, there)
    locale = place[1:].partition(" ")[0]
    heading = (flattened(world.world_from_locale(locale)).inverse() @ there).heading_rad
    return FirstGuess(place, heading, SIGMA_M, SIGMA_RAD)


def _next(out: Path) -> Path:
    """A directory for the run that begins again."""
    number = 2
    while (there := out.with_name(f"{out.name}-{number}")).exists():
        number += 1
    return there


class _Stream:
    """Odometry and pictures as they come.

    Attributes:
        began_s: stamp of the first picture of the run.
    """

    def __init__(self, node: RosNode, fall_silent: Callable[[str], None]) -> None:
        """``fall_silent``: is told what does not come, or comes late, and "" while all does."""
        self._node, self._fall_silent = node, fall_silent
        self._pictures: queue.SimpleQueue[Heard] = queue.SimpleQueue()
        self._newest_s, self._reader = 0.0, OdometryReader(node.types, node.late_s)
        self._late_since_s: float | None = None
        self.began_s: float | None = None
        node.look(self._pictures.put)

    def is_newest(self, time_s: float) -> bool:
        """Whether no newer picture waits: then an older one is not worth its time."""
        return time_s >= self._newest_s

    def items(self) -> Iterator[BagItem]:
        """For ever."""
        while True:
            heard = self._node.receive(SILENT_S)
            self._fall_silent(self._find_silence())
            yield from self._read_pictures()
            if heard is not None and heard[0] == "odom":
                try:
                    counted = self._reader.read(heard[1])
                except OdometryFault as fault:
                    print(f"odometry: {fault}", file=sys.stderr, flush=True)
                    continue
                if counted is None:
                    is_late = self._reader.is_late
                    self._late_since_s = (self._late_since_s or time.monotonic()) if is_late else self._late_since_s
                else:
                    there, self._late_since_s = counted.odometry, None
                    yield BagItem(there.time_s, Pose2(there.x_m, there.y_m, there.heading_rad))

    def _find_silence(self) -> str:
        age_s, pictures_s = self._node.picture_age_s(), self._node.robot.drive.pictures_s
        if age_s is not None and age_s > pictures_s:
            return f"no picture for {pictures_s:g} s"
        heard_s, now_s = self._node.odometry_came_s, time.monotonic()
        if heard_s is not None and now_s - heard_s > SILENT_S:
            return f"no odometry for {SILENT_S:g} s"
        is_late = self._late_since_s is not None and now_s - self._late_since_s > SILENT_S
        return "odometry comes later and later" if is_late else ""

    def _read_pictures(self) -> Iterator[BagItem]:
        while not self._pictures.empty():
            message = self._decode(self._pictures.get(), self._node.robot.topic("picture").type)
            item = None if message is None else read_picture_message(message)
            if item is not None:
                self._newest_s = max(self._newest_s, item.time_s)
                yield item

    def _decode(self, heard: Heard, kind: str) -> Any:
        try:
            return self._node.types.decode(heard.cdr, kind)
        except MessageError:
            return None
