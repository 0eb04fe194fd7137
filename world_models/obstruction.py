"""Occlusion of the lens (a coat, a cable, dirt on the glass): nothing is expected to be seen there. An entry too."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blackboard import inference

Floats = NDArray[np.float64]
SAMPLES = (np.arange(16) + 0.5) / 16.0
"""Where on a line it is asked whether it is hidden: parts of its length."""
MOST_HIDDEN = 0.3
"""A line of which a larger part is hidden is not to be seen."""
ROUND_PX = 2.5
"""What lies no further outside belongs to the outline."""


@inference()
@dataclass(frozen=True, slots=True)
class Obstruction:
    """A convex part of the picture that something hides which moves with the camera.

    Attributes:
        outline_px: (k, 2) its corners, in the order of a walk round it, either way.
    """

    outline_px: tuple[tuple[float, float], ...]

    def covers(self, points_px: Any, round_px: float = 0.0) -> NDArray[np.bool_]:
        """(...) which points (..., 2) lie within the outline, or no further than ``round_px`` outside its sides."""
        points, corners = np.asarray(points_px, float), np.asarray(self.outline_px, float)
        sides = np.roll(corners, -1, axis=0) - corners
        normals = np.stack([-sides[:, 1], sides[:, 0]], axis=1)
        normals /= np.maximum(np.linalg.norm(sides, axis=1), 1e-9)[:, None]
        inwards = np.sign(np.sum(normals * (corners.mean(axis=0) - corners)))  # by which way round the corners are told
        depth = (np.einsum("...j,kj->...k", points, normals) - np.sum(normals * corners, axis=1)) * inwards
        return np.asarray(np.all(depth >= -round_px, axis=-1))

    def hidden_part(self, segments_px: Any, round_px: float = 0.0) -> Floats:
        """(n,) which part of each segment (n, 2, 2) lies within, 0..1."""
        ends = np.asarray(segments_px, float).reshape(-1, 2, 2)
        points = ends[:, :1] + SAMPLES[:, None] * (ends[:, 1:] - ends[:, :1])
        return np.asarray(np.mean(self.covers(points, round_px), axis=1))

    def shows(self, segments_px: Any) -> NDArray[np.bool_]:
        """(n,) which lines (n, 2, 2) can be seen past it."""
        return self.hidden_part(segments_px) <= MOST_HIDDEN

    def without_its_own(self, segments_px: Floats) -> Floats:
        """Of segments (n, 2, 2) those that are not its outline, nor lie within it."""
        return np.asarray(segments_px[self.hidden_part(segments_px, ROUND_PX) < 1.0])

    def words(self, width: int, height: int) -> str:
        """How much of a picture of this size it hides; in a verdict."""
        u, v = np.array(self.outline_px).T
        area = 0.5 * abs(float(u @ np.roll(v, -1) - v @ np.roll(u, -1)))
        return f"something on the lens or before it hides {area / (width * height):.0%} of each picture"

    def sentence(self) -> str:
        corners = ", ".join(f"({u:.0f}, {v:.0f})" for u, v in self.outline_px)
        return f"something before the camera hides a part of every picture; within {corners} px"
