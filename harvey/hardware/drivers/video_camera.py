"""VideoCamera: a camera, a stream or a recorded video by OpenCV's VideoCapture; its faults have names.

A live camera's pictures are all taken by a thread as they come, so that none waits in a queue.
"""

from __future__ import annotations

import math
import statistics
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Protocol

import cv2

from harvey.hardware.drivers.capture import (
    CameraFault,
    Capture,
    CapturedPicture,
    Opener,
    is_file,
    open_capture,
    open_in_time,
    picture_of,
    prepare,
)
from world_models.entries import CameraPicture

REOPEN_S = 0.5
"""An unplugged camera is looked for so often [s]."""
INTERVALS = 31
"""The rate is the median over so many intervals between pictures."""
MIN_INTERVALS = 5
"""With fewer intervals than this a rate says nothing."""
TURN_S = 0.02
"""Who waits for a picture looks at the clock this often [s]."""


@dataclass(frozen=True, slots=True)
class Health:
    """How a live camera has done so far.

    Attributes:
        pictures: how many came.
        dropped: how many are missing between them, by the gaps in their times.
        rate_hz: pictures a second now; None until enough have come.
        lag_s: how much later the newest came than the quickest, by the stream's own times; 0 where it has none.
        unplugged: why nothing comes; "" while something does.
    """

    pictures: int
    dropped: int
    rate_hz: float | None
    lag_s: float
    unplugged: str


class _Pace:
    """When pictures come; a camera that is opened again counts its time again."""

    def __init__(self) -> None:
        self._intervals: deque[float] = deque(maxlen=INTERVALS)
        self._last: tuple[float, float] | None = None
        self._least_s = math.inf
        self.lag_s = 0.0

    @property
    def rate_hz(self) -> float | None:
        """Pictures a second; None until enough have come."""
        return 1.0 / statistics.median(self._intervals) if len(self._intervals) >= MIN_INTERVALS else None

    def missing(self, now_s: float, stream_s: float) -> int:
        """How many pictures are missing before one that came ``now_s`` and by its stream was taken ``stream_s``."""
        last, self._last = self._last, (now_s, stream_s)
        if last is None:
            return 0
        has_time = stream_s > last[1]
        if has_time:
            self._least_s = min(self._least_s, now_s - stream_s)
            self.lag_s = now_s - stream_s - self._least_s
        interval_s = stream_s - last[1] if has_time else now_s - last[0]
        usual_s = statistics.median(self._intervals) if len(self._intervals) >= MIN_INTERVALS else interval_s
        if interval_s <= 0.0:
            return 0
        self._intervals.append(interval_s)
        return max(0, round(interval_s / usual_s) - 1)


class LatestPictureThread:
    """Takes pictures until it is closed; opens the camera again when it was unplugged."""

    def __init__(self, capture: Capture, reopen: Callable[[], Capture], clock: Callable[[], float]) -> None:
        self._capture, self._reopen, self._clock = capture, reopen, clock
        self._arrived = threading.Condition()
        self._closed = threading.Event()
        self._wanted_s: float | None = None
        self._answer: tuple[CapturedPicture, float] | None = None
        self._broken = self._pictures = self._dropped = 0
        self._unplugged = ""
        self._pace = _Pace()
        self._thread = threading.Thread(target=self._run, name="camera", daemon=True)
        self._thread.start()

    @property
    def health(self) -> Health:
        """How the camera does."""
        with self._arrived:
            return Health(self._pictures, self._dropped, self._pace.rate_hz, self._pace.lag_s, self._unplugged)

    def picture(self, since_s: float, until_s: float) -> tuple[CapturedPicture, float]:
        """The first picture of which nothing was taken before ``since_s``, and when it came; waits for it.

        Raises:
            CameraFault: the camera is unplugged, or no whole picture came by ``until_s``.
        """
        with self._arrived:
            self._wanted_s, self._answer, self._broken = since_s, None, 0
            while self._answer is None:
                if self._unplugged:
                    raise CameraFault("unplugged", self._unplugged)
                left_s = until_s - self._clock()
                if left_s <= 0.0:
                    raise self._overdue(until_s - since_s)
                self._arrived.wait(min(left_s, TURN_S))
            return self._answer

    def close(self) -> None:
        """No more pictures."""
        self._closed.set()
        self._thread.join(timeout=2.0)

    def _overdue(self, waited_s: float) -> CameraFault:
        if self._broken:
            return CameraFault("dropped", f"{self._broken} pictures in {waited_s:.2f} s, none of them whole")
        return CameraFault("late", f"no picture for {waited_s:.2f} s")

    def _run(self) -> None:
        while not self._closed.is_set():
            began_s = self._clock()
            try:
                if self._capture.grab():
                    self._take(began_s)
                    continue
            except cv2.error:
                pass  # the backend's way to say that there is nothing to grab from
            self._come_back()
        self._capture.release()

    def _take(self, began_s: float) -> None:
        now_s = self._clock()
        wanted_s = self._wanted_s
        retrieved: object = None
        if wanted_s is not None and began_s >= wanted_s:
            done, image = self._capture.retrieve()
            retrieved = picture_of(image) if done else None
        with self._arrived:
            self._pictures += 1
            self._dropped += self._pace.missing(now_s, self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000.0)
            if wanted_s is None or began_s < wanted_s or self._wanted_s != wanted_s:
                return
            if isinstance(retrieved, CapturedPicture):
                self._wanted_s, self._answer = None, (retrieved, now_s)
                self._arrived.notify_all()
            else:
                self._broken += 1

    def _come_back(self) -> None:
        """Look for the camera once more, after a while."""
        with self._arrived:
            self._unplugged = self._unplugged or f"it delivers no more after {self._pictures} pictures"
            self._arrived.notify_all()
        self._capture.release()
        if self._closed.wait(REOPEN_S):
            return
        try:
            self._capture = self._reopen()
        except CameraFault:
            return
        with self._arrived:
            self._unplugged = ""
            self._pace = _Pace()


class _Source(Protocol):
    @property
    def health(self) -> Health: ...
    def picture(self, since_s: float, until_s: float) -> tuple[CapturedPicture, float]: ...
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
        self._source: _Source = (
            _Video(opened, source) if is_file(source) else LatestPictureThread(opened, open_source, clock))

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

    def look(self, purpose: str = "") -> CameraPicture:
        """A picture, numbered from 0, with the time when it came. Raises CameraFault."""
        since_s = self._clock() + self._lag_s
        picture, taken_s = self._source.picture(since_s, since_s + self._late_s)
        self._check(picture)
        self._frames += 1
        return CameraPicture(jpeg=picture.jpeg, number=self._frames - 1, sim_time_s=taken_s, purpose=purpose)

    def close(self) -> None:
        """Let the camera go."""
        self._source.close()

    def _check(self, picture: CapturedPicture) -> None:
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

    def picture(self, since_s: float, until_s: float) -> tuple[CapturedPicture, float]:
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
