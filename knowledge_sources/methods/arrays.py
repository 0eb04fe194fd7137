"""Names for the types of arrays; the shape, the unit and the frame are in the docstring of the function."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
"""Numbers: places, poses, directions, residuals, covariances."""

Floats32 = NDArray[np.float32]
"""Values of pixels or of places between them, where half the memory is worth it."""

Ints = NDArray[np.int64]
"""Whole numbers: counts and labels."""

Indices = NDArray[np.intp]
"""Places in another array."""

Mask = NDArray[np.bool_]
"""Which elements of another array are meant."""

Image = NDArray[np.uint8]
"""A picture: (h, w) grey levels, or (h, w, 3) in colour."""
