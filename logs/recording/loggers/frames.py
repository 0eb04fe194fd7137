"""Frames: the camera's JPEG bytes, kept as they came, so that a run can be decided again from its recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from logs.recording.board_mirror import Moment
from logs.recording.logger import Logger, Panel, Subject
from logs.recording.paths import CAMERA, IMAGE
from logs.recording.stream import RecordingStream
from world_models.entries.body import Frame

NUMBER = "number"
"""The component beside an image that holds the frame's number."""


class Picture:
    """Columns of a picture and of what is known about it."""

    @classmethod
    def columns(cls, **components: Any) -> Iterator[Any]:
        for name, values in components.items():
            if name == "blob":
                yield from rr.EncodedImage.columns(blob=values)
            else:
                yield from rr.AnyValues.columns(True, **{name: values})


class Frames(Logger):
    """Logs each picture as it is delivered."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._camera = subject.camera

    def panels(self) -> Sequence[Panel]:
        view = rrb.Spatial2DView(
            origin=CAMERA, name="Eye: yellow expected, cyan found, green fits, red not",
            visual_bounds=rrb.VisualBounds2D(x_range=[0, self._camera.width], y_range=[0, self._camera.height]))
        return (Panel(view, "world", 2, 9),)

    def begin(self, stream: RecordingStream) -> None:
        camera = self._camera
        stream.fix(CAMERA, rr.Pinhole(image_from_camera=camera.matrix, width=camera.width, height=camera.height))
        stream.fix(IMAGE, rr.EncodedImage.from_fields(media_type="image/jpeg"))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        for entry in moment.changed(Frame):
            frame = entry.value
            stream.log(IMAGE, Picture, blob=[frame.jpeg], **{NUMBER: [frame.number]}, purpose=[frame.purpose],
                     entry=[str(entry.ref)])


LOGGERS = (Frames,)
