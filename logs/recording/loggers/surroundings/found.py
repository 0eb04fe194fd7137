"""What the robot has found around it: contacts and echoes, free floor, things in the way, doors open or shut."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from logs.recording.board_mirror import Moment
from logs.recording.logger import Logger, Subject
from logs.recording.palette import BELIEVED, EXPECTED, FREE, MATCHED, REJECTED, Colour, faint
from logs.recording.paths import CONTACTS, DOORS, OBSTACLES, RANGES, SEEN_FLOOR
from logs.recording.stream import RecordingStream
from world_models import words
from world_models.entries.door_state import DoorCondition, DoorState
from world_models.entries.floor import FreeFloor
from world_models.entries.obstacle import Contact, Obstacle, Ranges
from world_models.entries.robot import Footprint
from world_models.frames import Pose2

BUMPER_M = 0.3
"""Of a bumper above the floor."""


class Contacts(Logger):
    """Logs a mark for each contact."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._belief = subject.belief
        self._places: list[tuple[float, float, float]] = []
        self._labels: list[str] = []

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        contacts = moment.changed(Contact)
        held = self._belief.now(moment.mirror) if contacts else None
        if held is None:
            return
        if not self._places:
            stream.fix(CONTACTS, rr.Points3D.from_fields(colors=[BELIEVED], radii=0.08, show_labels=False))
        footprint = moment.mirror.latest(Footprint)
        for contact in contacts:
            radius_m = 0.0 if footprint is None else footprint.value.radius_m
            self._places.append(place_of(contact.value, held.world_from_robot, radius_m))
            self._labels.append(words.brief(contact.value))
        stream.log(CONTACTS, rr.Points3D, positions=self._places, labels=self._labels)


def place_of(contact: Contact, world_from_robot: Pose2, radius_m: float) -> tuple[float, float, float]:
    """The point of the robot's rim that touched [m, world]."""
    angle = world_from_robot.heading_rad + contact.direction_rad
    return (world_from_robot.x_m + radius_m * math.cos(angle), world_from_robot.y_m + radius_m * math.sin(angle),
            BUMPER_M)


EAR_M = 0.6
"""Of the sensors above the floor."""


class RangeLines(Logger):
    """Logs the echoes of each reading, in the robot's frame."""

    _is_begun = False

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        for reading in moment.changed(Ranges):
            if not self._is_begun:  # most robots have no such sensors
                stream.fix(RANGES, rr.LineStrips3D.from_fields(colors=[faint(BELIEVED, 120)], radii=0.01))
                self._is_begun = True
            strips = [[(0.0, 0.0, EAR_M), (distance * math.cos(direction), distance * math.sin(direction), EAR_M)]
                      for direction, distance in reading.value.echoes]
            stream.log(RANGES, rr.LineStrips3D, strips=np.array(strips, np.float32).reshape(-1, 2, 3))


ABOVE_FLOOR_M = 0.03
"""So high above the floor it is drawn: on the floor itself it would flicker."""
OUTLINE_M = 0.02
OPACITY = 110

Outline = NDArray[np.float64]


class SeenFloor(Logger):
    """Logs the free floor of each picture and of each reading of range sensors, in place of the last one."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._world = subject.world
        self._begun: set[str] = set()

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        for entry in moment.changed(FreeFloor):
            floor, path = entry.value, f"{SEEN_FLOOR}/{entry.value.sense}"
            if path not in self._begun:  # most robots have no range sensors
                self._begun.add(path)
                stream.fix(path, rr.LineStrips3D.from_fields(colors=[faint(FREE, OPACITY)], radii=OUTLINE_M))
            height_m = self._world.floor_m(floor.locale) + ABOVE_FLOOR_M
            strips = [np.insert(outline, 2, height_m, axis=1).astype(np.float32) for outline in outlines(floor)]
            stream.log(path, rr.LineStrips3D, strips=strips)


def outlines(floor: FreeFloor) -> list[Outline]:
    """(k, 2) closed outlines of the free floor [m, world], one for each row of directions that have any."""
    bearings = np.array(floor.bearings_rad, float)
    near, far = np.array(floor.near_m, float), np.array(floor.far_m, float)
    is_free = far > near
    runs = np.split(np.arange(len(is_free)), np.flatnonzero(np.diff(is_free)) + 1) if len(is_free) else []
    return [_outline(floor, bearings[run], near[run], far[run]) for run in runs if is_free[run[0]] and len(run) > 1]


def _outline(floor: FreeFloor, bearings: Outline, near: Outline, far: Outline) -> Outline:
    ring = np.concatenate([np.column_stack([bearings, near])[::-1], np.column_stack([bearings, far])])
    points = np.column_stack([np.cos(ring[:, 0]), np.sin(ring[:, 0])]) * ring[:, 1:] + (floor.x_m, floor.y_m)
    return np.concatenate([points, points[:1]])


UNKNOWN_HEIGHT_M = 0.05
"""What nothing tells the height of is drawn so flat."""
LINE_M = 0.02

Floats = NDArray[np.float32]


class Obstacles(Logger):
    """Logs the edges of all that stands in the way, whenever one comes, is seen better, or goes."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._world = subject.world

    def begin(self, stream: RecordingStream) -> None:
        stream.fix(OBSTACLES, rr.LineStrips3D.from_fields(radii=LINE_M, show_labels=True))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        if not moment.touched(Obstacle):
            return
        strips, colours, labels = [], [], []
        for entry in moment.mirror.all(Obstacle):
            thing = entry.value
            if thing.status == "gone":
                continue
            for number, strip in enumerate(edges(thing, self._world.floor_m(thing.locale))):
                strips.append(strip)
                colours.append(colour_of(thing))
                labels.append(f"{thing.name}: {thing.status}, {thing.certainty:.0%}" if number == 0 else "")
        stream.log(OBSTACLES, rr.LineStrips3D, strips=strips, colors=colours, labels=labels)


def edges(thing: Obstacle, floor_m: float) -> Iterator[Floats]:
    """Of a box over its footprint: the top's outline first, then the bottom's, then the upright edges [m, world]."""
    corners = np.array(thing.footprint, float).reshape(-1, 2)
    top_m = floor_m + (thing.height_m if thing.is_height_known else UNKNOWN_HEIGHT_M)
    closed = np.concatenate([corners, corners[:1]])
    for height_m in (top_m, floor_m):
        yield np.insert(closed, 2, height_m, axis=1).astype(np.float32)
    for x, y in corners:
        yield np.array([(x, y, floor_m), (x, y, top_m)], np.float32)


def colour_of(thing: Obstacle) -> Colour:
    """From yellow, what may be there, to red, what certainly is; what is only suspected is fainter."""
    part = min(max(2.0 * thing.certainty - 1.0, 0.0), 1.0)
    red, green, blue = (round((1.0 - part) * a + part * b) for a, b in zip(EXPECTED[:3], REJECTED[:3], strict=True))
    return (red, green, blue, 255 if thing.is_there else 120)


COLOURS: Mapping[DoorCondition, Colour] = {
    "open": MATCHED, "shut": REJECTED, "ajar": REJECTED, "unknown": EXPECTED}
HEIGHTS_M: Mapping[DoorCondition, float] = {"open": 0.04, "shut": 1.0, "ajar": 1.0, "unknown": 0.5}
"""An open door is a line on the floor; one that cannot be passed is barred."""
BAR_M = 0.05


class DoorStates(Logger):
    """Logs a bar for each door, from jamb to jamb, green where it is open and red where it is not."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._world = subject.world
        self._doors = {door.name: door for door in subject.world.doorways}

    def begin(self, stream: RecordingStream) -> None:
        stream.fix(DOORS, rr.LineStrips3D.from_fields(radii=BAR_M, show_labels=True))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        if not moment.touched(DoorState):
            return
        states = [entry.value for entry in moment.mirror.all(DoorState) if entry.value.door in self._doors]
        strips = [self._bar(state) for state in states]
        labels = [f"{state.door}: {state.state}, {state.certainty:.0%}" for state in states]
        stream.log(DOORS, rr.LineStrips3D, strips=strips, colors=[COLOURS[state.state] for state in states],
                   labels=labels)

    def _bar(self, state: DoorState) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
        (left, right), (right_there, left_there) = self._doors[state.door].thresholds_world
        height_m = self._world.floor_m(state.between[0]) + HEIGHTS_M[state.state]
        return np.array([(*(np.add(a, b) / 2)[:2], height_m) for a, b in ((left, left_there), (right, right_there))],
                        np.float32)


LOGGERS = (Contacts, RangeLines, SeenFloor, Obstacles, DoorStates)
