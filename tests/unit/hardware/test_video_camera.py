"""VideoCamera: files and live cameras through a capture of our own, and what each fault is called."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from harvey.hardware.drivers.capture import CameraFault, open_capture, picture_of
from harvey.hardware.drivers.video_camera import VideoCamera
from video_file import write_video

SIZE = (64, 48)


def jpeg(level: int, size: tuple[int, int] = SIZE) -> bytes:
    image = np.full((size[1], size[0], 3), level, np.uint8)
    return cv2.imencode(".jpg", image)[1].tobytes()


class Clock:
    """Time that passes when a picture is fetched, so that no machine is too slow for these tests."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


class FakeCapture:
    """Delivers what it is given; with ``endless`` the last again and again, else nothing more."""

    def __init__(self, pictures: list[Any], *, endless: bool = True, opened: bool = True) -> None:
        self._left, self._endless, self._opened = deque(pictures), endless, opened
        self._now: Any = None
        self.clock = Clock()
        self.grabs = 0
        self.released = False

    def isOpened(self) -> bool:
        return self._opened

    def grab(self) -> bool:
        self.grabs += 1
        if not self._left:
            return False
        self._now = self._left[0] if self._endless and len(self._left) == 1 else self._left.popleft()
        return True

    def retrieve(self) -> tuple[bool, Any]:
        self.clock.now_s += 0.04
        return self._now is not None, np.frombuffer(self._now, np.uint8) if isinstance(self._now, bytes) else self._now

    def get(self, property: int, /) -> float:
        return 40.0 * self.grabs if property == cv2.CAP_PROP_POS_MSEC else 0.0

    def set(self, property: int, value: float, /) -> bool:
        return True

    def release(self) -> None:
        self.released = True


@pytest.fixture
def live() -> Iterator[Callable[..., VideoCamera]]:
    opened: list[VideoCamera] = []

    def made(*captures: FakeCapture, **more: Any) -> VideoCamera:
        ahead = iter(captures)
        clock = Clock()
        for capture in captures:
            capture.clock = clock
        options = {"clock": clock, "late_s": 0.5, "size": SIZE, **more}
        opened.append(VideoCamera("0", capture=lambda _source: next(ahead), **options))
        return opened[-1]

    yield made
    for camera in opened:
        camera.close()


def kind_of(camera: VideoCamera) -> str:
    with pytest.raises(CameraFault) as fault:
        camera.look("track")
    return fault.value.kind


def test_a_file_s_pictures_come_one_by_one_untouched(tmp_path: Path) -> None:
    pictures = [jpeg(level) for level in (40, 90, 140)]
    path = tmp_path / "camera.mjpeg"
    path.write_bytes(b"".join(pictures))
    with VideoCamera(str(path), SIZE, clock=lambda: 0.0) as camera:
        frames = [camera.look("milestone") for _ in pictures]
        assert [f.jpeg for f in frames] == pictures
        assert [f.number for f in frames] == [0, 1, 2]
        assert frames[0].purpose == "milestone"
        assert frames[0].sim_time_s < frames[1].sim_time_s < frames[2].sim_time_s
        assert kind_of(camera) == "unplugged"


@pytest.mark.parametrize("codec", ["FFV1", "MJPG"])
def test_what_is_written_as_a_video_is_read_again(tmp_path: Path, codec: str) -> None:
    path, levels = tmp_path / "video.avi", (40, 90, 140)
    write_video(path, [jpeg(level) for level in levels], codec=codec)
    with VideoCamera(str(path), SIZE, clock=lambda: 0.0) as camera:
        for level in levels:
            seen = cv2.imdecode(np.frombuffer(camera.look().jpeg, np.uint8), cv2.IMREAD_GRAYSCALE)
            assert seen is not None and abs(float(np.mean(seen)) - level) < 2.0


def test_a_source_that_does_not_open_is_unplugged(tmp_path: Path) -> None:
    with pytest.raises(CameraFault, match=r"unplugged: expected .* that opens, got '.*none\.avi'"):
        VideoCamera(str(tmp_path / "none.avi"), None, clock=lambda: 0.0)


def test_an_unplugged_camera_is_found_again(live: Callable[..., VideoCamera], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("harvey.hardware.drivers.video_camera.REOPEN_S", 0.0)
    gone = FakeCapture([jpeg(50), jpeg(50)], endless=False)
    camera = live(gone, FakeCapture([], opened=False), FakeCapture([jpeg(77)]))
    seen = b""
    for _ in range(10_000):
        try:
            seen = camera.look().jpeg
        except CameraFault as fault:
            assert fault.kind in ("unplugged", "late")
        if seen == jpeg(77):
            break
    assert seen == jpeg(77) and gone.released


def test_what_is_no_picture_is_none() -> None:
    assert picture_of(np.zeros((3, 3), np.float64)) is None
    assert picture_of(np.zeros(0, np.uint8)) is None
    assert not open_capture("/nowhere/at/all.avi").isOpened()
