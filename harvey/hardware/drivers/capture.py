"""Where pictures come from: OpenCV's VideoCapture, asked for the bytes that the camera compressed itself where it can.

A camera or a file that delivers MJPG hands its JPEGs over untouched; whatever else comes is decoded by OpenCV, and
compressed again here.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, Literal, Protocol, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from world_models.plugins import CAMERAS_GROUP, list_absent, load_plugins

QUALITY = 95
"""JPEG quality of pictures that do not come compressed as JPEG."""
BLACK_LEVEL, BLACK_SHARE = 8, 0.001
"""A picture in which hardly a pixel is brighter than this grey level is black: noise in the dark stays below it."""
MAX_DEVICE = 255
"""Linux numbers no more video devices [/dev/video255]."""
MAX_OPEN_S = 30.0
"""A camera that is not open by then does not open: a pipe into which nobody writes, a server that does not answer."""
MJPG = cv2.VideoWriter.fourcc(*"MJPG")

CameraFaultKind = Literal["unplugged", "late", "dropped", "dark", "wrong size"]
"""How a camera fails.

unplugged: it cannot be opened, or delivers no more. late: no picture in time, too few a second, or a stream that lags.
dropped: pictures came, but none was whole. dark: a picture came, and it is black. wrong size: its size is not the one
that was calibrated.
"""


class CameraFault(Exception):
    """A camera did not deliver what it was asked for.

    Attributes:
        kind: how it failed.
        detail: in words, for the user.
    """

    def __init__(self, kind: CameraFaultKind, detail: str) -> None:
        if kind not in get_args(CameraFaultKind):
            raise ValueError(f"expected a kind of fault, one of {get_args(CameraFaultKind)}, got {kind!r}")
        super().__init__(f"the camera: {kind}: {detail}")
        self.kind: CameraFaultKind = kind
        self.detail = detail


class Capture(Protocol):
    """What is used of cv2.VideoCapture."""

    def isOpened(self) -> bool: ...
    def grab(self) -> bool: ...
    def retrieve(self) -> tuple[bool, Any]: ...
    def get(self, property: int, /) -> float: ...
    def set(self, property: int, value: float, /) -> bool: ...
    def release(self) -> None: ...


Opener = Callable[[str], Capture]


@dataclass(frozen=True, slots=True)
class CameraKind:
    """A kind of camera that another package brings, as it is named before the colon: ``ros2:robot.toml``.

    Attributes:
        name: of the kind.
        open: its pictures, by what stands behind the colon; raises CameraFault.
    """

    name: str
    open: Opener


@cache
def camera_kinds() -> Mapping[str, CameraKind]:
    """Every such kind by its name. Raises PluginError where one cannot be loaded."""
    return load_plugins(CAMERAS_GROUP, CameraKind)


def _kind_of(source: str) -> tuple[CameraKind, str] | None:
    """The kind of a source, and where it is; None for what OpenCV opens."""
    name, colon, where = source.partition(":")
    return (camera_kinds()[name], where) if colon and name in camera_kinds() else None


@dataclass(frozen=True, slots=True)
class CapturedPicture:
    """One picture: its JPEG bytes, size [px], and whether it is black."""

    jpeg: bytes
    size: tuple[int, int]
    is_black: bool


class _Untimed:
    """A capture whose pictures have no times: for motion JPEG over HTTP OpenCV makes some up, 25 a second."""

    def __init__(self, capture: cv2.VideoCapture) -> None:
        self._capture = capture
        self.isOpened, self.grab, self.retrieve = capture.isOpened, capture.grab, capture.retrieve
        self.set, self.release = capture.set, capture.release

    def get(self, property: int, /) -> float:
        return 0.0 if property == cv2.CAP_PROP_POS_MSEC else self._capture.get(property)


def open_capture(source: str) -> Capture:
    """VideoCapture of a device by its number, a file or a URL."""
    # CameraFault says what is wrong; OpenCV's own messages would only come between.
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    if source.isdecimal() and int(source) > MAX_DEVICE:
        raise CameraFault("unplugged", f"expected a device's number from 0 to {MAX_DEVICE}, got {source}")
    if (found := _kind_of(source)) is not None:
        return found[0].open(found[1])
    capture = cv2.VideoCapture(int(source) if source.isdecimal() else source)
    return _Untimed(capture) if source.startswith(("http://", "https://")) else capture


def open_in_time(open_source: Opener, source: str, max_open_s: float = MAX_OPEN_S) -> Capture:
    """Open a source in a thread of its own, because OpenCV may wait for ever, and hears no signal meanwhile.

    Raises:
        CameraFault: it is not open in time.
    """
    opened: SimpleQueue[Capture | Exception] = SimpleQueue()

    def work() -> None:
        try:
            opened.put(open_source(source))
        except Exception as error:
            opened.put(error)

    threading.Thread(target=work, name="camera opener", daemon=True).start()
    try:
        capture = opened.get(timeout=max_open_s)
    except Empty:
        raise CameraFault("unplugged", f"{source!r} did not open within {max_open_s:g} s") from None
    if isinstance(capture, Exception):
        raise capture
    return capture


def is_file(source: str) -> bool:
    """Whether a source is a file, whose pictures wait for us, and not a device, a pipe or a stream, whose do not."""
    path = Path(source)
    if _kind_of(source) is not None:
        return False
    special = re.match(r"[a-z][a-z0-9+.-]*://", source) or source.startswith("/dev/") or path.is_fifo()
    return not (source.isdecimal() or special) or path.is_file()


def prepare(capture: Capture, source: str, size: tuple[int, int] | None) -> Capture:
    """An opened capture, set to hand over JPEGs as they come and, a device, to the size wanted. Raises CameraFault."""
    if not capture.isOpened():
        needs = list_absent(CAMERAS_GROUP).get(source.partition(":")[0])
        raise CameraFault("unplugged", f"expected a device's number, a video file or a URL that opens, got {source!r}"
                                       f"{f'; it needs {needs}' if needs else ''}")
    if is_file(source):
        if _is_mjpg(capture):
            capture.set(cv2.CAP_PROP_FORMAT, -1)
    elif source.isdecimal() or source.startswith("/dev/"):
        capture.set(cv2.CAP_PROP_FOURCC, MJPG)
        if size is not None:
            capture.set(cv2.CAP_PROP_FRAME_WIDTH, size[0])
            capture.set(cv2.CAP_PROP_FRAME_HEIGHT, size[1])
        capture.set(cv2.CAP_PROP_CONVERT_RGB, 0 if _is_mjpg(capture) else 1)
    return capture


def picture_of(retrieved: Any) -> CapturedPicture | None:
    """What a capture retrieves, JPEG bytes or an image (h, w[, 3]) uint8, as a picture; None where it is not whole."""
    image = np.asarray(retrieved)
    if image.dtype != np.uint8 or not image.size:
        return None
    try:
        if image.ndim == 1 or 1 in image.shape[:2]:
            return _of_bytes(image.tobytes())
        return _of_image(image)
    except cv2.error:
        return None


def _of_bytes(data: bytes) -> CapturedPicture | None:
    # A picture that breaks off is filled up with grey by the decoder without a word: look for the end mark.
    data = data[:_find_end(data)]
    if not data.startswith(b"\xff\xd8"):
        return None
    grey = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE)
    return None if grey is None else CapturedPicture(data, grey.shape[::-1], _is_black(grey))


def _find_end(jpeg: bytes) -> int:
    """Where a JPEG ends, behind its end mark; some cameras pad it. 0 where it breaks off.

    Segments are skipped by their lengths: a small picture within one has an end mark too.
    """
    at = jpeg.find(b"\xff", 2)
    while 0 <= at < len(jpeg) - 1:
        mark = jpeg[at + 1]
        if mark == 0xD9:
            return at + 2
        if mark == 0xFF:  # one that fills
            at += 1
            continue
        bare = mark in (0x00, 0x01) or 0xD0 <= mark <= 0xD8  # a byte of the picture, or a mark without a length
        at = jpeg.find(b"\xff", at + 2 + (0 if bare else int.from_bytes(jpeg[at + 2:at + 4], "big")))
    return 0


def _of_image(image: NDArray[np.uint8]) -> CapturedPicture | None:
    done, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    height, width = image.shape[:2]
    return CapturedPicture(data.tobytes(), (width, height), _is_black(image)) if done else None


def _is_black(pixels: NDArray[Any]) -> bool:
    return bool(np.count_nonzero(pixels > BLACK_LEVEL) < BLACK_SHARE * pixels.size)


def _is_mjpg(capture: Capture) -> bool:
    return int(capture.get(cv2.CAP_PROP_FOURCC)) == MJPG
