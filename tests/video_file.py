"""A stream of pictures as a video file that any player, and VideoCamera, can read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np


def write_video(path: Path, jpegs: Sequence[bytes], *, codec: str) -> None:
    """Write whole pictures of one size into an AVI file, ten a second.

    Of the codecs, FFV1 keeps the pixels as they were decoded; MJPG compresses them once more.
    """
    images = [cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR) for jpeg in jpegs]
    assert images[0] is not None
    height, width = images[0].shape[:2]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), 10.0, (width, height))
    assert writer.isOpened()
    for image in images:
        assert image is not None
        writer.write(image)
    writer.release()
