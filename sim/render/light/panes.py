"""Window panes among the faces of a building."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from sim.render.mesh import FaceLike

MIN_BLUE = 0.8
"""Of the pane's colour; frames are darker."""


def find_panes(faces: Iterable[FaceLike]) -> NDArray[np.bool_]:
    """(P,) which patches of the mesh of these faces are window panes: bright regions of things named "window"."""
    regions = [region for face in faces for side in (face.front, face.back) for region in side]
    return np.array(["window" in r.name and r.colour[2] > MIN_BLUE for r in regions], dtype=bool)
