"""The camera's mirror image in a plane: what a shiny floor or a pane shows is the building, seen from there.

A mirrored camera is left-handed. So it is turned upside down too, which makes it right-handed, and so is its picture.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sim.render.mesh import Pinhole

Floats = NDArray[np.float64]
UPSIDE_DOWN = np.diag([1.0, -1.0, 1.0])


def mirror_camera(
    lens: Pinhole, rotation: Floats, translation: Floats, plane: Floats
) -> tuple[Pinhole, Floats, Floats]:
    """The camera whose picture, with its rows in reverse, shows the building mirrored in a plane (n, d), n . p = d.

    Args:
        rotation, translation: camera_from_world, (3, 3) and (3,) [m].

    Returns its lens, rotation and translation.
    """
    normal, offset = plane[:3], plane[3]
    householder = np.eye(3) - 2.0 * np.outer(normal, normal)
    moved = rotation @ (2.0 * offset * normal) + translation
    upside_down = replace(lens, cy=lens.height - 1.0 - lens.cy)
    return upside_down, UPSIDE_DOWN @ rotation @ householder, UPSIDE_DOWN @ moved


def before_plane(vertices_world: Floats, first: NDArray[np.int64], plane: Floats) -> NDArray[np.bool_]:
    """(P,) which patches reach before a plane by more than a millimetre: only these are seen in it."""
    heights = vertices_world @ plane[:3] - plane[3]
    return np.asarray(np.maximum.reduceat(heights, first[:-1]) > 1e-3)
