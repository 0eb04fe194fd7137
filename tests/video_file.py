"""A stream of pictures as a video file that any player, and VideoCamera, can read."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np

CODECS = ("FFV1", "MJPG")
"""FFV1 keeps the pixels as they were decoded; MJPG compresses them once more, and what that loses is lost."""


def write_video(path: Path, jpegs: Iterable[bytes], *, codec: str = "FFV1", rate_hz: float = 10.0) -> int:
    """Write pictures of one size into an AVI file; returns how many. The times between them are all made equal.

    Raises:
        ValueError: an unknown codec, no pictures, or one that is not whole or of another size than the first.
        OSError: the file cannot be written.
    """
    if codec not in CODECS:
        raise ValueError(f"expected one of {', '.join(CODECS)}, got {codec!r}")
    writer: cv2.VideoWriter | None = None
    shape: tuple[int, ...] = ()
    number = 0
    for number, jpeg in enumerate(jpegs, 1):
        image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
        if image is None or (writer is not None and image.shape != shape):
            got = "one that is not whole" if image is None else f"one of shape {image.shape}"
            raise ValueError(f"expected pictures of one size, got {got} as number {number - 1}")
        if writer is None:
            shape = image.shape
            writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), rate_hz, (shape[1], shape[0]))
            if not writer.isOpened():
                raise OSError(f"{path}: expected a video file that can be written")
        writer.write(image)
    if writer is None:
        raise ValueError("expected pictures, got none")
    writer.release()
    return number
