"""Whether doors are open or shut, by what pictures show: a bar across each opening that was judged."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import rerun as rr

from logs.recording.board_mirror import Moment
from logs.recording.logger import Logger, Subject
from logs.recording.palette import EXPECTED, MATCHED, REJECTED, Colour
from logs.recording.paths import DOORS
from logs.recording.stream import RecordingStream
from world_models.entries.door_state import DoorCondition, DoorState

COLOURS: Mapping[DoorCondition, Colour] = {
    "open": MATCHED, "shut": REJECTED, "ajar": REJECTED, "unknown": EXPECTED}
HEIGHTS_M: Mapping[DoorCondition, float] = {"open": 0.04, "shut": 1.0, "ajar": 1.0, "unknown": 0.5}
"""An open door is a line on the floor; one that cannot be passed is barred."""
LINE_M = 0.05


class DoorStates(Logger):
    """Logs a bar for each door, from jamb to jamb, green where it is open and red where it is not."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._world = subject.world
        self._doors = {door.name: door for door in subject.world.doorways}

    def begin(self, stream: RecordingStream) -> None:
        stream.fix(DOORS, rr.LineStrips3D.from_fields(radii=LINE_M, show_labels=True))

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


LOGGER = DoorStates
