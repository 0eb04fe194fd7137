"""Which picture of a live camera answers, how long is waited, what the faults say; and what a camera is asked for.

The clock is the test's: each time that the one who waits looks at it, the next thing of a script happens.
"""

from __future__ import annotations

import statistics
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from harvey.hardware.drivers import capture as captures
from harvey.hardware.drivers.capture import CameraFault, CapturedPicture, is_file, open_in_time, picture_of, prepare
from harvey.hardware.drivers.video_camera import Health, LatestPictureThread, VideoCamera, _Pace, _Video
from video_file import write_video

MAIN = threading.main_thread()


def jpeg(level: int) -> bytes:
    return cv2.imencode(".jpg", np.full((48, 64, 3), level, np.uint8))[1].tobytes()


class Bench:
    """A camera that hangs, so that only the test hands pictures over, and a clock with a script."""

    def __init__(self) -> None:
        self.now_s, self.stream_s = 0.0, 0.0
        self.script: list[Callable[[], None]] = []
        self.retrieved: Any = None
        self.was_retrieved = self.released = 0
        self.let_go = threading.Event()
        self.waits: list[float] = []
        self.reopened: Callable[[], Any] = lambda: self
        self.newest = LatestPictureThread(self, lambda: self.reopened(), self.clock)
        self.newest._arrived.wait = lambda timeout=None: bool(self.waits.append(timeout or 0.0))  # type: ignore[method-assign]

    def clock(self) -> float:
        if threading.current_thread() is MAIN and self.script:
            self.script.pop(0)()
        return self.now_s

    def comes(self, began_s: float, now_s: float, image: Any) -> Callable[[], None]:
        """A picture whose fetching began and ended at these times."""
        def come() -> None:
            self.now_s, self.retrieved = now_s, image
            ahead, self.script = self.script, []  # taking it looks at the clock too
            self.newest._take(began_s)
            self.script = ahead
        return come

    def passes(self, now_s: float) -> Callable[[], None]:
        """Nothing but time."""
        return lambda: setattr(self, "now_s", now_s)

    def isOpened(self) -> bool:
        return True

    def grab(self) -> bool:
        self.let_go.wait(20.0)
        return False

    def retrieve(self) -> tuple[bool, Any]:
        self.was_retrieved += 1
        return self.retrieved is not None, np.frombuffer(self.retrieved or b"", np.uint8)

    def get(self, property: int, /) -> float:
        return 1000.0 * self.stream_s if property == cv2.CAP_PROP_POS_MSEC else 0.0

    def set(self, property: int, value: float, /) -> bool:
        return True

    def release(self) -> None:
        self.released += 1


@pytest.fixture
def bench() -> Iterator[Bench]:
    made = Bench()
    yield made
    made.newest._closed.set()
    made.let_go.set()
    made.newest.close()


def test_the_first_picture_begun_after_the_call_answers_and_says_when_it_came(bench: Bench) -> None:
    bench.script = [bench.passes(1.0), bench.comes(0.999, 1.02, jpeg(10)), bench.passes(1.03),
                    bench.comes(1.0, 1.05, jpeg(20)), bench.passes(1.06), bench.comes(1.06, 1.1, jpeg(30))]
    picture, came_s = bench.newest.picture(1.0, 2.0)
    assert (picture.jpeg, came_s) == (jpeg(20), 1.05) and bench.was_retrieved == 1
    assert bench.newest.health.pictures == 2


@pytest.mark.parametrize(("images", "fault"), [
    ([], "late: no picture for 1.25 s"), ([jpeg(3)[:100]] * 3, "dropped: 3 pictures in 1.25 s, none of them whole"),
    ([None], "dropped: 1 pictures in 1.25 s, none of them whole"),
])
def test_what_did_not_come_in_time_is_told_with_the_time_that_was_waited(
    bench: Bench, images: list[Any], fault: str
) -> None:
    bench.script = [bench.passes(5.0)]
    bench.script += [bench.comes(5.1 + 0.1 * at, 5.11 + 0.1 * at, image) for at, image in enumerate(images)]
    bench.script += [bench.passes(6.2499), bench.passes(6.25)]
    with pytest.raises(CameraFault) as caught:
        bench.newest.picture(5.0, 6.25)
    assert str(caught.value) == f"the camera: {fault}" and caught.value.kind == fault.split(":")[0]
    assert bench.waits and all(0.0 < wait <= 0.02 for wait in bench.waits)
    assert bench.waits[-1] == pytest.approx(0.0001, abs=1e-6)


def test_what_was_broken_before_does_not_count_for_the_next_call(bench: Bench) -> None:
    bench.script = [bench.comes(0.1, 0.2, b"broken"), bench.passes(1.0)]
    with pytest.raises(CameraFault, match="dropped: 1 pictures"):
        bench.newest.picture(0.0, 1.0)
    bench.script = [bench.passes(3.0)]
    with pytest.raises(CameraFault, match="late"):
        bench.newest.picture(1.0, 2.0)


def test_a_camera_that_is_gone_is_said_to_be_until_it_is_there_again(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits: list[float] = []

    def reopen() -> Any:
        raise CameraFault("unplugged", "still gone")

    bench.comes(0.0, 0.1, None)()
    monkeypatch.setattr(bench.newest._closed, "wait", lambda timeout: bool(waits.append(timeout)))
    bench.reopened = reopen
    bench.newest._come_back()
    bench.newest._come_back()
    assert waits == [0.5, 0.5] and bench.released == 2
    with pytest.raises(CameraFault, match="unplugged: it delivers no more after 1 pictures"):
        bench.newest.picture(0.0, 1.0)
    bench.reopened = lambda: bench
    bench.newest._come_back()
    assert bench.newest.health == Health(1, 0, None, 0.0, "")


@settings(max_examples=60)
@given(st.lists(st.floats(0.01, 0.5), min_size=1, max_size=50), st.booleans())
def test_rate_and_gaps_follow_the_median_of_the_last_31_intervals(intervals: list[float], has_time: bool) -> None:
    """From five intervals on; by the stream's own times where it has any."""
    pace, seen = _Pace(), list[float]()
    now_s = stream_s = 7.0
    assert pace.missing(now_s, stream_s if has_time else 0.0) == 0 and pace.rate_hz is None
    for interval in intervals:
        now_s += interval + (0.003 if has_time else 0.0)
        before_s, stream_s = stream_s, stream_s + interval
        step = stream_s - before_s if has_time else interval
        usual = statistics.median(seen[-31:]) if len(seen) >= 5 else step
        missing = pace.missing(now_s, stream_s if has_time else 0.0)
        if abs(step / usual % 1.0 - 0.5) > 1e-6:
            assert missing == max(0, round(step / usual) - 1)
        seen.append(step)
        if len(seen) < 5:
            assert pace.rate_hz is None
        else:
            assert pace.rate_hz == pytest.approx(1.0 / statistics.median(seen[-31:]))


@given(st.lists(st.floats(0.0, 2.0), min_size=2, max_size=30))
def test_lag_is_how_much_later_than_the_quickest_a_picture_comes(delays: list[float]) -> None:
    pace = _Pace()
    for at, delay in enumerate(delays):
        pace.missing(10.0 * at + delay, 3.0 + 10.0 * at)
        if at:
            assert pace.lag_s == pytest.approx(delay - min(delays[1:at + 1]), abs=1e-9)


class Told:
    """A source that answers with what it is told, and keeps what it is asked."""

    def __init__(self, level: int = 100, rate_hz: float | None = None, lag_s: float = 0.0) -> None:
        self.health = Health(9, 0, rate_hz, lag_s, "")
        self.asked: list[tuple[float, float]] = []
        self._picture = picture_of(np.frombuffer(jpeg(level), np.uint8))

    def picture(self, since_s: float, until_s: float) -> tuple[CapturedPicture, float]:
        self.asked.append((since_s, until_s))
        assert self._picture is not None
        return self._picture, since_s + 0.125

    def close(self) -> None:
        """Nothing is open."""


def looking(source: Told, tmp_path: Path, **more: Any) -> VideoCamera:
    write_video(tmp_path / "any.avi", [jpeg(9)], codec="MJPG")
    camera = VideoCamera(str(tmp_path / "any.avi"), more.pop("size", (64, 48)), clock=lambda: 20.0, **more)
    camera.close()
    camera._source = source
    return camera


def test_a_look_asks_for_what_is_taken_from_now_on_and_numbers_it(tmp_path: Path) -> None:
    source = Told()
    camera = looking(source, tmp_path, late_s=0.75, lag_s=0.25)
    frames = [camera.look("track") for _ in range(3)]
    assert source.asked == [(20.25, 21.0)] * 3 and [frame.number for frame in frames] == [0, 1, 2]
    assert all((frame.sim_time_s, frame.purpose, frame.jpeg) == (20.375, "track", jpeg(100)) for frame in frames)


@pytest.mark.parametrize(("source", "fault"), [
    (Told(rate_hz=12.0), None), (Told(rate_hz=11.9), "late: 12 pictures a second are needed, 11.9 come"),
    (Told(lag_s=0.75), None), (Told(lag_s=0.76), "late: the stream lags 0.8 s behind"),
    (Told(level=0), "dark: the picture is black: is the lens covered?"), (Told(rate_hz=None), None),
])
def test_a_camera_that_is_too_slow_lags_or_is_dark(source: Told, fault: str | None, tmp_path: Path) -> None:
    camera = looking(source, tmp_path, late_s=0.75, rate_hz=12.0)
    if fault is None:
        camera.look()
        return
    with pytest.raises(CameraFault) as caught:
        camera.look()
    assert str(caught.value) == f"the camera: {fault}"


def test_pictures_of_another_size_are_a_fault(tmp_path: Path) -> None:
    with pytest.raises(CameraFault, match="wrong size: expected pictures of 48 x 64 px, as calibrated, got 64 x 48"):
        looking(Told(), tmp_path, size=(48, 64)).look()


@pytest.mark.parametrize(("bright", "is_black"), [(9, True), (10, False)])
def test_a_picture_is_black_where_less_than_a_thousandth_is_bright(bright: int, is_black: bool) -> None:
    image = np.full((100, 100), 8, np.uint8)
    image.flat[:bright] = 9
    picture = picture_of(image)
    assert picture is not None and picture.is_black == is_black and picture.size == (100, 100)


def test_images_are_compressed_with_quality_95_and_keep_their_size() -> None:
    image = np.random.default_rng(0).integers(0, 256, (30, 50, 3), np.uint8)
    picture = picture_of(image)
    jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()
    assert picture == CapturedPicture(jpeg, (50, 30), False)


@pytest.mark.parametrize("behind", [b"", bytes(5000), b"\xff\xff\xd9 and more"])
def test_a_jpeg_is_whole_up_to_its_own_end_mark(behind: bytes) -> None:
    small = jpeg(77)  # within a segment, as telephones put one there
    whole = small[:2] + b"\xff\xe1" + (len(small) + 2).to_bytes(2, "big") + small + small[2:]
    data = np.frombuffer(whole + behind, np.uint8)
    for shaped in (data, data[None, :], data[:, None]):
        assert picture_of(shaped) == CapturedPicture(whole, (64, 48), False)
    assert picture_of(data[1:]) is None and picture_of(data[:len(whole) - 2]) is None


@pytest.mark.parametrize(("source", "expected"), [
    ("0", False), ("255", False), ("/dev/video0", False), ("http://here/video", False), ("rtsp://here", False),
    ("film.avi", True), ("/some/film.avi", True),
])
def test_what_is_a_file(source: str, expected: bool) -> None:
    assert is_file(source) == expected


def test_no_device_has_a_number_above_255(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(captures.cv2, "VideoCapture", lambda source: asked.append(source) or Settable(0))
    captures.open_capture("255")
    captures.open_capture("film.avi")
    assert asked == [255, "film.avi"]
    with pytest.raises(CameraFault, match="from 0 to 255, got 256"):
        captures.open_capture("256")


class Settable:
    """A capture that keeps what is set, and delivers this codec."""

    def __init__(self, codec: int) -> None:
        self._codec = codec
        self.kept: list[tuple[int, float]] = []
        self.grab = self.retrieve = self.release = lambda: None

    def isOpened(self) -> bool:
        return True

    def get(self, property: int, /) -> float:
        return self._codec if property == cv2.CAP_PROP_FOURCC else 12.5

    def set(self, property: int, value: float, /) -> bool:
        self.kept.append((property, value))
        return True


MJPG = ord("M") | ord("J") << 8 | ord("P") << 16 | ord("G") << 24


@pytest.mark.parametrize(("source", "codec", "size", "kept"), [
    ("film.avi", MJPG, (64, 48), [(cv2.CAP_PROP_FORMAT, -1)]), ("film.avi", 0, (64, 48), []),
    ("0", MJPG, (64, 48), [(cv2.CAP_PROP_FOURCC, MJPG), (cv2.CAP_PROP_FRAME_WIDTH, 64),
                           (cv2.CAP_PROP_FRAME_HEIGHT, 48), (cv2.CAP_PROP_CONVERT_RGB, 0)]),
    ("/dev/video1", 0, None, [(cv2.CAP_PROP_FOURCC, MJPG), (cv2.CAP_PROP_CONVERT_RGB, 1)]),
    ("http://here/video", MJPG, (64, 48), []),
])
def test_what_a_source_is_set_to(source: str, codec: int, size: tuple[int, int] | None, kept: list[Any]) -> None:
    capture = Settable(codec)
    prepare(capture, source, size)  # type: ignore[arg-type]
    assert capture.kept == kept


def test_a_stream_over_http_has_no_times_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(captures.cv2, "VideoCapture", lambda source: Settable(0))
    for source, time_ms in (("http://here", 0.0), ("https://here", 0.0), ("rtsp://here", 12.5), ("0", 12.5)):
        opened = captures.open_capture(source)
        assert opened.get(cv2.CAP_PROP_POS_MSEC) == time_ms and opened.get(cv2.CAP_PROP_FPS) == 12.5


def test_what_does_not_open_in_time_is_given_up() -> None:
    hangs = threading.Event()
    with pytest.raises(CameraFault, match=r"unplugged: 'slow' did not open within 0\.05 s"):
        open_in_time(lambda source: hangs.wait(20.0), "slow", 0.05)  # type: ignore[arg-type, return-value]
    hangs.set()


def test_a_video_tells_which_picture_is_not_whole_and_where_it_ends(tmp_path: Path) -> None:
    capture = Bench.__new__(Bench)  # no thread: a file is read picture by picture
    images = iter([jpeg(9), b"", jpeg(99)])
    capture.stream_s, capture.was_retrieved, capture.retrieved = 2.5, 0, None

    def grab() -> bool:
        capture.retrieved = next(images, "end")
        return capture.retrieved != "end"

    capture.grab = grab  # type: ignore[method-assign]
    video = _Video(capture, "film.avi")
    picture, taken_s = video.picture(0.0, 1.0)
    assert (picture.jpeg, taken_s) == (jpeg(9), 2.5)
    with pytest.raises(CameraFault, match=r"dropped: picture 1 of film\.avi is not whole"):
        video.picture(0.0, 1.0)
    assert video.picture(0.0, 1.0)[0].jpeg == jpeg(99)
    with pytest.raises(CameraFault, match=r"unplugged: film\.avi ends after 3 pictures"):
        video.picture(0.0, 1.0)
    assert video.health == Health(3, 1, None, 0.0, "")
