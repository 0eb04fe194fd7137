"""What is seen of the floor, over the camera's picture: the free floor, its boundary, boxes round what stands on it.

Lines of the free floor are drawn from its near side to its far side, one a direction: together they are a translucent
area. The boundary is coloured by what ends the floor.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from logs.recording.board_mirror import Moment
from logs.recording.logger import Logger, Subject
from logs.recording.palette import DONE, EXPECTED, FREE, REJECTED, Colour, faint
from logs.recording.paths import DOOR_IN_PICTURE, FLOOR_BOUNDARY, FREE_IN_PICTURE, THINGS
from logs.recording.stream import RecordingStream
from world_models.camera import clip_segments
from world_models.entries.body import Frame
from world_models.entries.door_state import DoorState
from world_models.entries.floor import FloorEnd, FloorThing, FreeFloor
from world_models.frames import Pose2

ENDS: Mapping[FloorEnd, Colour] = {"thing": REJECTED, "model": DONE, "sight": FREE}
"""Of the boundary, by what ends the floor there."""
OPACITY = 50

Floats = NDArray[np.float64]


class FloorInPicture(Logger):
    """Logs the floor that is seen in the newest picture, and takes it away when the next one comes."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._belief, self._mount = subject.belief, subject.mount
        self._lens, self._pinhole = subject.camera, subject.camera.pinhole
        self._size = subject.camera.width, subject.camera.height
        self._is_floor_shown = self._is_door_shown = False

    def begin(self, stream: RecordingStream) -> None:
        stream.fix(FREE_IN_PICTURE, rr.LineStrips2D.from_fields(
            colors=[faint(FREE, OPACITY)], radii=rr.Radius.ui_points(2.0)))
        stream.fix(FLOOR_BOUNDARY, rr.LineStrips2D.from_fields(radii=rr.Radius.ui_points(1.5)))
        for path in (THINGS, DOOR_IN_PICTURE):
            stream.fix(path, rr.Boxes2D.from_fields(radii=rr.Radius.ui_points(1.5), show_labels=True))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        if moment.touched(Frame):
            self._wipe(stream)
        for entry in moment.changed(FreeFloor):
            if entry.value.sense == "camera":
                self._log_floor(stream, moment, entry.value)
        doors = [entry.value for entry in moment.changed(DoorState)]
        if doors:
            colours = [FREE if door.is_passable else REJECTED for door in doors]
            _log_boxes(stream, DOOR_IN_PICTURE, self._bounds(door.last.box_px for door in doors), colours,
                       [f"{door.door}: {door.last.shows}" for door in doors])
            self._is_door_shown = True

    def _wipe(self, stream: RecordingStream) -> None:
        if self._is_floor_shown:
            for path in (FREE_IN_PICTURE, FLOOR_BOUNDARY):
                stream.log(path, rr.LineStrips2D, strips=np.zeros((0, 2, 2), np.float32))
            _log_boxes(stream, THINGS, np.zeros((0, 4)), [], [])
        if self._is_door_shown:
            _log_boxes(stream, DOOR_IN_PICTURE, np.zeros((0, 4)), [], [])
        self._is_floor_shown = self._is_door_shown = False

    def _log_floor(self, stream: RecordingStream, moment: Moment, floor: FreeFloor) -> None:
        held = self._belief.now(moment.mirror)
        if held is None or not floor.bearings_rad:
            return
        near, far = np.array(floor.near_m, float), np.array(floor.far_m, float)
        is_free = far > near
        columns = np.stack([self._place(floor, held.world_from_robot, reach) for reach in (near, far)], axis=1)
        lines, inside = self._clip(columns[is_free])
        stream.log(FREE_IN_PICTURE, rr.LineStrips2D, strips=self._bend(lines[inside]).astype(np.float32))
        rims = np.array([*pairwise(columns[is_free, 1])], float).reshape(-1, 2, 2)
        ends = [end for end, free in zip(floor.ends, is_free, strict=True) if free]
        rims, inside = self._clip(rims)
        stream.log(FLOOR_BOUNDARY, rr.LineStrips2D, strips=self._bend(rims[inside]).astype(np.float32),
                   colors=[ENDS[end] for end, shown in zip(ends, inside, strict=False) if shown])
        _log_boxes(stream, THINGS, self._bounds(thing.box_px for thing in floor.things),
                   [REJECTED if thing.p_thing > 0.5 else EXPECTED for thing in floor.things],
                   [label_of(thing) for thing in floor.things])
        self._is_floor_shown = True

    def _place(self, floor: FreeFloor, world_from_robot: Pose2, reach_m: Floats) -> Floats:
        """(n, 2) pixels of the floor at these distances from the camera; nan behind it."""
        bearings = np.array(floor.bearings_rad, float)
        points = np.column_stack([floor.x_m + reach_m * np.cos(bearings), floor.y_m + reach_m * np.sin(bearings)])
        in_robot = world_from_robot.inverse().lifted().apply(np.insert(points, 2, 0.0, axis=1))
        in_camera = self._mount.camera_from_robot.apply(in_robot)
        pixels = np.asarray(self._pinhole.project(in_camera), float)
        pixels[in_camera[:, 2] <= 0.0] = np.nan
        return pixels

    def _clip(self, lines: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        known = np.asarray(np.isfinite(lines)).all(axis=(1, 2))
        clipped, inside = clip_segments(np.nan_to_num(lines), *self._size)
        return clipped, inside & known

    def _bend(self, pixels: Floats) -> Floats:
        """Where points of the rectified picture lie in the camera's."""
        return pixels if self._pinhole is self._lens else self._lens.project(self._pinhole.rays(pixels))

    def _bounds(self, boxes: Iterator[tuple[float, float, float, float]]) -> Floats:
        """(n, 4) boxes as they lie in the camera's picture, cut at its border."""
        corners = self._bend(np.array([*boxes], float).reshape(-1, 2, 2))
        return np.clip(corners, 0.0, np.subtract(self._size, 1.0)).reshape(-1, 4)


def label_of(thing: FloorThing) -> str:
    """``0.42 m high, 97%``."""
    high = f"{thing.height_m:.2f} m high, " if np.isfinite(thing.sigma_height_m) else ""
    return f"{high}{thing.p_thing:.0%}"


def _log_boxes(stream: RecordingStream, path: str, bounds: Floats, colours: list[Colour], labels: list[str]) -> None:
    low, high = bounds[:, :2], bounds[:, 2:]
    stream.log(path, rr.Boxes2D, centers=(low + high) / 2, half_sizes=(high - low) / 2, colors=colours, labels=labels)


LOGGERS = (FloorInPicture,)
