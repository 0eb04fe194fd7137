"""Pictures out of messages, of a live camera and of recordings: CompressedImage, and Image in the usual encodings."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

MOST_PX = 100_000_000
"""A larger picture is none."""
JPEG, PNG = b"\xff\xd8", b"\x89PNG\r\n\x1a\n"
CHANNELS = {"mono8": 1, "8UC1": 1, "mono16": 1, "rgb8": 3, "bgr8": 3, "8UC3": 3, "rgba8": 4, "bgra8": 4, "8UC4": 4,
            "rgb16": 3, "bgr16": 3, "rgba16": 4, "bgra16": 4,
            **{f"bayer_{tile}{bits}": 1 for tile in ("rggb", "bggr", "gbrg", "grbg") for bits in (8, 16)},
            "yuv422": 2, "uyvy": 2, "yuyv": 2, "yuv422_yuy2": 2, "nv12": 1, "nv21": 1}
"""The encodings of raw pictures that are understood, with the numbers of a pixel."""
TO_BGR = {"rgb": cv2.COLOR_RGB2BGR, "rgba": cv2.COLOR_RGBA2BGR, "bgra": cv2.COLOR_BGRA2BGR, "8UC4": cv2.COLOR_BGRA2BGR,
          "bayer_rggb": cv2.COLOR_BayerRGGB2BGR, "bayer_bggr": cv2.COLOR_BayerBGGR2BGR,
          "bayer_gbrg": cv2.COLOR_BayerGBRG2BGR, "bayer_grbg": cv2.COLOR_BayerGRBG2BGR,
          "yuv422": cv2.COLOR_YUV2BGR_UYVY, "uyvy": cv2.COLOR_YUV2BGR_UYVY, "yuyv": cv2.COLOR_YUV2BGR_YUYV,
          "yuv422_yuy2": cv2.COLOR_YUV2BGR_YUYV, "nv12": cv2.COLOR_YUV2BGR_NV12, "nv21": cv2.COLOR_YUV2BGR_NV21}
"""How OpenCV makes blue, green and red of them; by the name without its bits."""


def retrieve_picture(message: Any) -> NDArray[np.uint8] | str:
    """JPEG bytes (n,) or pixels (h, w[, 3]), blue first, of a message; else why not, as ``of the encoding '32FC1'``."""
    if hasattr(message, "format"):
        return decompress_picture(np.asarray(message.data, np.uint8), str(message.format))
    return _read_pixels(message)


def decompress_picture(data: NDArray[np.uint8], said: str) -> NDArray[np.uint8] | str:
    """The same of compressed bytes (n,), of which somebody said what they are."""
    begin = data[:24].tobytes()
    if said.startswith(("16UC1", "32FC1")) or "compressedDepth" in said:
        return f"that show depth, of the format {said[:40]!r}"
    if begin.startswith(JPEG):
        return data
    if begin.startswith(PNG) and int.from_bytes(begin[16:20], "big") * int.from_bytes(begin[20:24], "big") > MOST_PX:
        return f"of more than {MOST_PX} pixels"
    try:
        pixels = cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None
    except cv2.error:
        pixels = None
    return f"of the format {said[:40]!r} that are not whole, or no pictures" if pixels is None else (
        np.asarray(pixels, np.uint8))


def _read_pixels(message: Any) -> NDArray[np.uint8] | str:
    encoding = str(message.encoding)
    if encoding not in CHANNELS:
        return f"of the encoding {encoding[:40]!r}"
    height, width, step = int(message.height), int(message.width), int(message.step)
    row_bytes = width * CHANNELS[encoding] * (2 if encoding.endswith("16") else 1)
    rows = height * 3 // 2 if encoding.startswith("nv") else height  # the colours lie below the grey levels
    data = np.asarray(message.data, np.uint8)
    if not row_bytes or not height or step < row_bytes or len(data) < (rows - 1) * step + row_bytes:
        return f"of the encoding {encoding!r} that are not whole"
    whole = np.zeros(rows * step, np.uint8)  # the last row need not be filled up
    whole[:min(len(data), rows * step)] = data[:rows * step]
    packed = np.ascontiguousarray(whole.reshape(rows, step)[:, :row_bytes])
    if encoding.endswith("16"):  # the upper byte of each number
        packed = np.ascontiguousarray(packed[:, 0 if message.is_bigendian else 1::2])
    if CHANNELS[encoding] > 1:
        packed = packed.reshape(rows, width, CHANNELS[encoding])
    code = TO_BGR.get(encoding) or TO_BGR.get(encoding.rstrip("0123456789"))
    try:
        return packed if code is None else np.asarray(cv2.cvtColor(packed, code), np.uint8)
    except cv2.error:
        return f"of the encoding {encoding!r} and {width} x {height} px"
