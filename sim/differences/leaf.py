"""The leaf of a door that the model has open: shut in its opening, or hinged at a jamb and ajar."""

from __future__ import annotations

import math

import numpy as np

from sim.differences.shapes import OAK, STEEL
from sim.differences.table import TrueDoor
from world_models.building.geometry.faces import Face
from world_models.building.geometry.solids import Box, Range, Solid
from world_models.building.locales import Doorway
from world_models.files.construction.doors import LEAF_DEPTH_M
from world_models.files.construction.rooms import CASING_DEPTH_M
from world_models.frames import Pose

THICKNESS_M = 0.045
HANDLE_M: tuple[Range, Range, float] = ((0.05, 0.13), (0.98, 1.06), 0.05)
"""Of a door handle: how far from the leaf's free edge, how high, how far off the leaf."""


def build_leaf(door: TrueDoor, doorway: Doorway, floor_m: float) -> tuple[Face, ...]:
    """The faces of a leaf. A shut one fills its opening, set back as the model's closed doors are.

    One that is ajar is hinged at a jamb before the casing, and swings into ``door.into``.
    """
    locale = door.into or doorway.between[0]
    left, right = doorway.threshold_of(locale)
    hinge, free = (left, right) if door.hinge == "left" else (right, left)
    inward = -doorway.outward_from(locale)
    along = (free - hinge) / np.linalg.norm(free - hinge)
    side = float(np.sign(along[0] * inward[1] - along[1] * inward[0]))
    is_shut = door.state == "shut"
    foot = hinge + (-LEAF_DEPTH_M if is_shut else CASING_DEPTH_M) * inward
    turn_rad = math.atan2(along[1], along[0]) + (0.0 if is_shut else side * door.open_rad)
    world_from_leaf = Pose.from_rotation_vector(np.array([0.0, 0.0, turn_rad]), np.array([*foot, floor_m]))
    across = (-THICKNESS_M, 0.0) if side > 0.0 else (0.0, THICKNESS_M)
    width = doorway.width_m
    (near, far), heights, off = HANDLE_M
    boxes = (Box((0.0, width), across, (0.0, doorway.height_m), OAK),
             Box((width - far, width - near), (across[0] - off, across[1] + off), heights, STEEL))
    return tuple(Solid(f"{doorway.name}/true-leaf", boxes, world_from_leaf).faces(locale))
