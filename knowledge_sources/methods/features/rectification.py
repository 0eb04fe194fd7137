"""Rectification: the picture as a camera without lens distortion would have taken it.

Straight edges are then straight in the picture. The alternative is to find segments in the raw picture and to
undistort their ends; ``harvey experiment lens`` measures both.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from knowledge_sources.methods.arrays import Floats32, Image
from knowledge_sources.methods.features.images import decode
from world_models.camera import Camera


class Rectifier:
    """Decodes and rectifies the pictures of a camera with lens distortion.

    As :func:`decode` it caches the last few, as landmarks' templates lie in earlier pictures.
    """

    def __init__(self, lens: Camera, pinhole: Camera) -> None:
        """Build the map between the two pictures.

        Args:
            lens: the camera as it is.
            pinhole: the camera without distortion to whose pictures they are brought.

        Raises:
            ValueError: ``pinhole`` has distortion.
        """
        if pinhole.distortion is not None:
            raise ValueError(f"expected a camera without distortion to put pictures into, got {pinhole}")
        self._size = lens.width, lens.height
        self._map = None if lens.distortion is None else _build_map(lens, pinhole)
        self._rectify_cached = lru_cache(maxsize=8)(self._decode_and_rectify)

    def __call__(self, jpeg: bytes) -> Image:
        """Decode and rectify a compressed picture to grey levels (h, w). Raises ValueError: it is not a picture."""
        return decode(jpeg) if self._map is None else self._rectify_cached(jpeg)

    def rectify(self, raw: Image) -> Image:
        """Rectify a picture (h, w[, 3]) of the camera. Raises ValueError for one of another size."""
        if self._map is None:
            return raw
        if raw.shape[1::-1] != self._size:
            expected = " x ".join(map(str, self._size))
            raise ValueError(f"expected a picture of {expected} px, got one of shape {raw.shape}")
        image = cv2.remap(raw, *self._map, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(image, np.uint8)

    def _decode_and_rectify(self, jpeg: bytes) -> Image:
        image = self.rectify(decode(jpeg))
        image.setflags(write=False)
        return image


@lru_cache(maxsize=4)
def get_rectifier(lens: Camera, pinhole: Camera) -> Rectifier:
    """The rectifier of a camera; the last few are kept."""
    return Rectifier(lens, pinhole)


def _build_map(lens: Camera, pinhole: Camera) -> tuple[Floats32, Floats32]:
    """Column and row (h, w) in the raw picture of each pixel of the rectified one [px]."""
    grid = np.stack(np.meshgrid(np.arange(pinhole.width), np.arange(pinhole.height)), axis=-1)
    u, v = np.moveaxis(lens.project(pinhole.rays(grid)), -1, 0).astype(np.float32)
    return np.ascontiguousarray(u), np.ascontiguousarray(v)
