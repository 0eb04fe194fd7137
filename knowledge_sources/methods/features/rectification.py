"""The picture as a camera without lens distortion would have taken it.

Straight edges are straight again before anything is looked for in it. The other way is to find segments in the picture
as it came and to straighten their ends; ``harvey experiment lens`` measures both.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.features.images import decode
from world_models.camera import Camera


class Rectifier:
    """Decodes pictures of a camera with lens distortion as those of one without.

    As :func:`decode` it remembers the last few: landmarks' templates lie in earlier pictures.
    """

    def __init__(self, lens: Camera, pinhole: Camera) -> None:
        """``lens``: the camera as it is; ``pinhole``: what its pictures are put into, without distortion."""
        if pinhole.distortion is not None:
            raise ValueError(f"expected a camera without distortion to put pictures into, got {pinhole}")
        self._size = lens.width, lens.height
        self._places = None if lens.distortion is None else _places(lens, pinhole)
        self._straightened = lru_cache(maxsize=8)(self._straighten)

    def __call__(self, jpeg: bytes) -> NDArray[np.uint8]:
        """The grey picture (h, w) uint8 in compressed bytes. Raises ValueError: the bytes are not a picture."""
        return decode(jpeg) if self._places is None else self._straightened(jpeg)

    def _straighten(self, jpeg: bytes) -> NDArray[np.uint8]:
        image = self.rectify(decode(jpeg))
        image.setflags(write=False)
        return image

    def rectify(self, raw: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """A picture (h, w[, 3]) uint8 of the camera, without its distortion. Raises ValueError for one of another size.
        """
        if self._places is None:
            return raw
        if raw.shape[1::-1] != self._size:
            expected = " x ".join(map(str, self._size))
            raise ValueError(f"expected a picture of {expected} px, got one of shape {raw.shape}")
        image = cv2.remap(raw, *self._places, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(image, np.uint8)


def _places(lens: Camera, pinhole: Camera) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Column and row (h, w) where each pixel of the picture without distortion lies in the one with it [px]."""
    grid = np.stack(np.meshgrid(np.arange(pinhole.width), np.arange(pinhole.height)), axis=-1)
    u, v = np.moveaxis(lens.project(pinhole.rays(grid)), -1, 0).astype(np.float32)
    return np.ascontiguousarray(u), np.ascontiguousarray(v)
