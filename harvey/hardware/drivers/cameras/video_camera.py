"""VideoCamera: a camera, a stream or a recorded video by OpenCV's VideoCapture; its faults have names."""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType
from typing import Protocol

import cv2

from harvey.hardware.drivers.cameras.capture import (
    CameraFault,
    CameraFaultKind,
    Capture,
    Opener,
    Picture,
    is_file,
    open_capture,
    open_in_time,
    picture_of,
    prepare,
)
from harvey.hardware.drivers.cameras.newest_picture import Health, Newest
from world_models.entries.body import Frame

__all__ = ["CameraFault", "CameraFaultKind", "Health", "VideoCamera"]


class _Source(Protocol):
    @property
    def health(self) -> Health: ...
    def picture(self, since_s: float, until_s: float) -> tuple[Picture, float]: ...
    def close(self) -> None: ...


class VideoCamera:
    """A camera that is looked through.

    A live camera answers with the first picture that was taken wholly after the call. A file's pictures are handed
    over one after the other, one for each look, at the times that the file says.
    """

    def __init__(
        self,
        source: str,
        size: tuple[int, int] | None,
        *,
        clock: Callable[[], float],
        late_s: float = 1.0,
        rate_hz: float = 0.0,
        lag_s: float = 0.0,
        capture: Opener = open_capture,
    ) -> None:
        """Open it.

        Args:
            source: number of a device (``"0"``), a file, or a URL.
            size: (width, height) that pictures must have, as calibrated [px]; None takes any.
            clock: seconds since the mission began.
            late_s: a picture that is not there so long after it was asked for is late, and so is a stream that lags so
                much behind what it was at best [s].
            rate_hz: pictures a second that are needed.
            lag_s: how long a picture takes from the sensor to here, where that is known [s].
            capture: opens a source.

        Raises:
            CameraFault: the source cannot be opened.
        """
        self._size, self._clock = size, clock
        self._late_s, self._rate_hz, self._lag_s = late_s, rate_hz, lag_s
        self._frames = 0

        def open_source() -> Capture:
            return prepare(open_in_time(capture, source), source, size)

        opened = open_source()
        self._source: _Source = _Video(opened, source) if is_file(source) else Newest(opened, open_source, clock)

    def __enter__(self) -> VideoCamera:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def health(self) -> Health:
        """How the camera has done so far: dropped pictures, rate, lag."""
        return self._source.health

    def look(self, purpose: str = "") -> Frame:
        """A picture, numbered from 0, with the time when it came. Raises CameraFault."""
        since_s = self._clock() + self._lag_s
        picture, taken_s = self._source.picture(since_s, since_s + self._late_s)
        self._check(picture)
        self._frames += 1
        return Frame(jpeg=picture.jpeg, number=self._frames - 1, sim_time_s=taken_s, purpose=purpose)

    def close(self) -> None:
        """Let the camera go."""
        self._source.close()

    def _check(self, picture: Picture) -> None:
        if self._size is not None and picture.size != self._size:
            expected, got = (f"{width} x {height}" for width, height in (self._size, picture.size))
            raise CameraFault("wrong size", f"expected pictures of {expected} px, as calibrated, got {got}")
        if picture.is_black:
            raise CameraFault("dark", "the picture is black: is the lens covered?")
        health = self.health
        if health.rate_hz is not None and health.rate_hz < self._rate_hz:
            raise CameraFault("late", f"{self._rate_hz:g} pictures a second are needed, {health.rate_hz:.1f} come")
        if health.lag_s > self._late_s:
            raise CameraFault("late", f"the stream lags {health.lag_s:.1f} s behind")


class _Video:
    """A recorded video, picture by picture."""

    def __init__(self, capture: Capture, name: str) -> None:
        self._capture, self._name = capture, name
        self._pictures, self._broken = 0, 0

    @property
    def health(self) -> Health:
        return Health(self._pictures, self._broken, None, 0.0, "")

    def picture(self, since_s: float, until_s: float) -> tuple[Picture, float]:
        """The next one, and its time in the video. Raises CameraFault at the end, or where it is not whole."""
        if not self._capture.grab():
            raise CameraFault("unplugged", f"{self._name} ends after {self._pictures} pictures")
        done, image = self._capture.retrieve()
        picture = picture_of(image) if done else None
        self._pictures += 1
        if picture is None:
            self._broken += 1
            raise CameraFault("dropped", f"picture {self._pictures - 1} of {self._name} is not whole")
        return picture, self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000.0

    def close(self) -> None:
        self._capture.release()
