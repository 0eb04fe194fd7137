"""What stands in the way and is not in the model: its footprint, as high as is known, coloured by certainty."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from logs.recording.board_mirror import Moment
from logs.recording.logger import Logger, Subject
from logs.recording.palette import EXPECTED, REJECTED, Colour
from logs.recording.paths import OBSTACLES
from logs.recording.stream import RecordingStream
from world_models.entries.obstacle import Obstacle

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


LOGGER = Obstacles
