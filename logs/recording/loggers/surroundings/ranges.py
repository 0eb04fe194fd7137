"""What range sensors hear: a line from the believed robot to each echo."""

from __future__ import annotations

import math

import numpy as np
import rerun as rr

from logs.recording.board_mirror import Moment
from logs.recording.logger import Logger
from logs.recording.palette import BELIEVED, faint
from logs.recording.paths import RANGES
from logs.recording.stream import RecordingStream
from world_models.entries.touch import Ranges

HEIGHT_M = 0.6
"""Of the sensors above the floor."""


class RangeLines(Logger):
    """Logs the echoes of each reading, in the robot's frame."""

    _is_begun = False

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        for reading in moment.changed(Ranges):
            if not self._is_begun:  # most robots have no such sensors
                stream.fix(RANGES, rr.LineStrips3D.from_fields(colors=[faint(BELIEVED, 120)], radii=0.01))
                self._is_begun = True
            strips = [[(0.0, 0.0, HEIGHT_M), (distance * math.cos(direction), distance * math.sin(direction), HEIGHT_M)]
                      for direction, distance in reading.value.echoes]
            stream.log(RANGES, rr.LineStrips3D, strips=np.array(strips, np.float32).reshape(-1, 2, 3))


LOGGER = RangeLines
