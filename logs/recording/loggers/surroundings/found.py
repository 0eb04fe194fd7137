"""What the robot has found: contacts and echoes, the map of the floor, things in the way, doors open or shut."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np
import rerun as rr

from knowledge_sources.methods.floor import CELL_M, FloorMap
from logs.recording.logger import Logger, Moment, Subject
from logs.recording.loggers.surroundings.model_building import Strip, across, strip
from logs.recording.palette import BELIEVED, EXPECTED, MATCHED, REJECTED, Colour, faint
from logs.recording.paths import CONTACTS, DOORS, OBSTACLES, RANGES, SEEN_FLOOR
from logs.recording.stream import RecordingStream
from world_models import words
from world_models.entries import Contact, DoorCondition, DoorState, Footprint, FreeFloor, Obstacle, Ranges

BUMPER_M, EAR_M = 0.3, 0.6
"""Of a bumper and of range sensors above the floor."""
ABOVE_FLOOR_M, OPACITY = 0.03, 0.5
LINE_M = 0.02
UNKNOWN_HEIGHT_M = 0.05
"""What nothing tells the height of is drawn so flat."""
COLOURS: Mapping[DoorCondition, Colour] = {"open": MATCHED, "shut": REJECTED, "unknown": EXPECTED}
HEIGHTS_M: Mapping[DoorCondition, float] = {"open": 0.04, "shut": 1.0, "unknown": 0.5}
"""An open door is a line on the floor; one that cannot be passed is barred."""
BAR_M = 0.05


class Felt(Logger):
    """Logs a mark for each contact, where the robot's rim touched; and the echoes of each reading of range sensors."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._places: list[tuple[float, float, float]] = []
        self._labels: list[str] = []

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        if moment.held is not None and (contacts := moment.changed(Contact)):
            if not self._places:
                stream.fix(CONTACTS, rr.Points3D.from_fields(colors=[BELIEVED], radii=0.08, show_labels=False))
            footprint, pose = moment.mirror.latest(Footprint), moment.held.world_from_robot
            radius_m = 0.0 if footprint is None else footprint.value.radius_m
            for contact in contacts:
                angle = pose.heading_rad + contact.value.direction_rad
                x_m, y_m = pose.x_m + radius_m * math.cos(angle), pose.y_m + radius_m * math.sin(angle)
                self._places.append((x_m, y_m, BUMPER_M))
                self._labels.append(words.brief(contact.value))
            stream.log(CONTACTS, rr.Points3D, positions=self._places, labels=self._labels)
        for reading in moment.changed(Ranges):
            if self.is_new(RANGES, "begun"):  # most robots have no such sensors
                stream.fix(RANGES, rr.LineStrips3D.from_fields(colors=[faint(BELIEVED, 120)], radii=0.01))
            strips = [[(0.0, 0.0, EAR_M), (distance * math.cos(direction), distance * math.sin(direction), EAR_M)]
                      for direction, distance in reading.value.echoes]
            stream.log(RANGES, rr.LineStrips3D, strips=np.array(strips, np.float32).reshape(-1, 2, 3))


class MapOfFloor(Logger):
    """Logs how probably something stands on each cell of the floor, by the sights of it that are on the board."""

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        if not (seen := moment.changed(FreeFloor)):
            return
        floor_m = self.subject.world.floor_m(seen[-1].value.locale)
        sights = [entry.value for entry in moment.mirror.all(FreeFloor)]
        (x_m, y_m), cells = FloorMap([one for one in sights if self.subject.world.floor_m(one.locale) == floor_m],
                                     np.zeros((0, 3))).draw()
        if self.is_new(SEEN_FLOOR, "begun"):
            stream.fix(SEEN_FLOOR, rr.GridMap.from_fields(cell_size=CELL_M, colormap="RvizMap", opacity=OPACITY))
        rows, columns = cells.shape
        stream.log(SEEN_FLOOR, rr.GridMap, data=[cells.tobytes()], format=[rr.components.ImageFormat(
            width=columns, height=rows, color_model="L", channel_datatype="U8")],
            translation=[(x_m, y_m, floor_m + ABOVE_FLOOR_M)])


class ObstacleEdges(Logger):
    """Logs the edges of all that stands in the way, whenever one comes, is seen better, or goes."""

    def begin(self, stream: RecordingStream) -> None:
        stream.fix(OBSTACLES, rr.LineStrips3D.from_fields(radii=LINE_M, show_labels=True))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        if not moment.touched(Obstacle):
            return
        strips, colours, labels = [], [], []
        for thing in (entry.value for entry in moment.mirror.all(Obstacle) if entry.value.status != "gone"):
            for number, edge in enumerate(edges(thing, self.subject.world.floor_m(thing.locale))):
                strips.append(edge)
                colours.append(colour_of(thing))
                labels.append(f"{thing.name}: {thing.status}, {thing.certainty:.0%}" if number == 0 else "")
        stream.log(OBSTACLES, rr.LineStrips3D, strips=strips, colors=colours, labels=labels)


def edges(thing: Obstacle, floor_m: float) -> Iterator[Strip]:
    """Of a box over its footprint: the top's outline first, then the bottom's, then the upright edges [m, world]."""
    corners = np.array(thing.footprint, float).reshape(-1, 2)
    top_m = floor_m + (thing.height_m if thing.is_height_known else UNKNOWN_HEIGHT_M)
    closed = np.concatenate([corners, corners[:1]])
    yield from (strip(closed, height_m) for height_m in (top_m, floor_m))
    yield from (np.array([(x, y, floor_m), (x, y, top_m)], np.float32) for x, y in corners)


def colour_of(thing: Obstacle) -> Colour:
    """From yellow, what may be there, to red, what certainly is; what is only suspected is fainter."""
    part = min(max(2.0 * thing.certainty - 1.0, 0.0), 1.0)
    red, green, blue = (round((1.0 - part) * a + part * b) for a, b in zip(EXPECTED[:3], REJECTED[:3], strict=True))
    return (red, green, blue, 255 if thing.is_there else 120)


class DoorStates(Logger):
    """Logs a bar for each door, from jamb to jamb, green where it is open and red where it is not."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._doors = {door.name: door for door in subject.world.doorways}

    def begin(self, stream: RecordingStream) -> None:
        stream.fix(DOORS, rr.LineStrips3D.from_fields(radii=BAR_M, show_labels=True))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        if moment.touched(DoorState):
            states = [entry.value for entry in moment.mirror.all(DoorState) if entry.value.door in self._doors]
            stream.log(DOORS, rr.LineStrips3D, strips=[self._bar(state) for state in states],
                       colors=[COLOURS[state.state] for state in states],
                       labels=[f"{state.door}: {state.state}, {state.certainty:.0%}" for state in states])

    def _bar(self, state: DoorState) -> Strip:
        height_m = self.subject.world.floor_m(state.between[0]) + HEIGHTS_M[state.state]
        return strip(across(self._doors[state.door]), height_m)


LOGGERS = (Felt, MapOfFloor, ObstacleEdges, DoorStates)
