"""How far the floor is seen or ranged to be free, in plan: the outline of the newest scan of either sense."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from logs.recording.board_mirror import Moment
from logs.recording.logger import Logger, Subject
from logs.recording.palette import FREE, faint
from logs.recording.paths import SEEN_FLOOR
from logs.recording.stream import RecordingStream
from world_models.entries.floor import FreeFloor

ABOVE_FLOOR_M = 0.03
"""So high above the floor it is drawn: on the floor itself it would flicker."""
LINE_M = 0.02
OPACITY = 110

Floats = NDArray[np.float64]


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
                stream.fix(path, rr.LineStrips3D.from_fields(colors=[faint(FREE, OPACITY)], radii=LINE_M))
            height_m = self._world.floor_m(floor.locale) + ABOVE_FLOOR_M
            strips = [np.insert(outline, 2, height_m, axis=1).astype(np.float32) for outline in outlines(floor)]
            stream.log(path, rr.LineStrips3D, strips=strips)


def outlines(floor: FreeFloor) -> list[Floats]:
    """(k, 2) closed outlines of the free floor [m, world], one for each row of directions that have any."""
    bearings = np.array(floor.bearings_rad, float)
    near, far = np.array(floor.near_m, float), np.array(floor.far_m, float)
    is_free = far > near
    runs = np.split(np.arange(len(is_free)), np.flatnonzero(np.diff(is_free)) + 1) if len(is_free) else []
    return [_outline(floor, bearings[run], near[run], far[run]) for run in runs if is_free[run[0]] and len(run) > 1]


def _outline(floor: FreeFloor, bearings: Floats, near: Floats, far: Floats) -> Floats:
    ring = np.concatenate([np.column_stack([bearings, near])[::-1], np.column_stack([bearings, far])])
    points = np.column_stack([np.cos(ring[:, 0]), np.sin(ring[:, 0])]) * ring[:, 1:] + (floor.x_m, floor.y_m)
    return np.concatenate([points, points[:1]])


LOGGER = SeenFloor
