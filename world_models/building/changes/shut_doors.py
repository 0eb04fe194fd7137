"""A doorway found shut: what a camera may expect of it from either room."""

from __future__ import annotations

import zlib
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from world_models.building.geometry.faces import Face, build_barrier
from world_models.building.geometry.regions import UNKNOWN
from world_models.building.geometry.scene import LocaleGeometry
from world_models.building.locales import Doorway

SAME_PLACE_M = 1e-3
"""Corners no further apart than this on the plan are the same."""


def shut_door(parts: tuple[LocaleGeometry, ...], doorway: Doorway, floor_m: float) -> tuple[LocaleGeometry, ...]:
    """The geometry of one of a doorway's two locales, with the door shut.

    The faces of type doorway go; the shut faces come into the parts that the two locales share. Both locales' geometry
    gets the same shared parts. The numbers of the shut faces follow from their names: negative, and so apart from those
    of the world's own faces.

    Args:
        parts: own and shared parts of the locale.
        floor_m: height of the floor at the doorway [m, world].
    """
    shut = build_shut_faces(doorway, floor_m)
    changed = {(part.locale, part.neighbour): _without_opening(part, doorway) for part in parts}
    for face in shut:
        key = face.locale, face.neighbour
        part = changed.get(key) or LocaleGeometry(*key, (), ())
        faces = dict(part.faces) | {_number_of(face): face}
        changed[key] = replace(part, faces=tuple(sorted(faces.items())))
    return tuple(changed.values())


def build_shut_faces(doorway: Doorway, floor_m: float) -> tuple[Face, Face]:
    """Two one-sided barriers that fill an opening, one at the threshold of each locale, facing that locale.

    The model does not know how deep the leaf hangs in the opening, nor what colour it has. So nothing within the
    opening is expected to be seen, and no colour is claimed.

    Args:
        floor_m: height of the floor at the doorway [m, world].
    """
    first, second = (_build_shut_face(doorway, locale, floor_m) for locale in doorway.between)
    return first, second


def _build_shut_face(doorway: Doorway, locale: str, floor_m: float) -> Face:
    left, right = doorway.threshold_of(locale)
    top_m = floor_m + doorway.height_m
    corners = [(*left, floor_m), (*right, floor_m), (*right, top_m), (*left, top_m)]
    return build_barrier(f"{locale}/{doorway.name}/shut", locale, corners, UNKNOWN, neighbour=doorway.other(locale))


def _number_of(face: Face) -> int:
    return -1 - zlib.crc32(face.name.encode())


def _without_opening(part: LocaleGeometry, doorway: Doorway) -> LocaleGeometry:
    """A part without the faces of type doorway that fill this opening."""
    kept = tuple((number, face) for number, face in part.faces if not _fills(face, doorway))
    return part if len(kept) == len(part.faces) else replace(part, faces=kept)


def _fills(face: Face, doorway: Doorway) -> bool:
    """Whether this is a face of type doorway whose corners are all at the jambs' feet on the plan."""
    if face.kind != "doorway" or {face.locale, face.neighbour} != set(doorway.between):
        return False
    feet: NDArray[np.float64] = doorway.thresholds_world.reshape(4, 2)
    away_m = np.linalg.norm(face.polygon_world[:, None, :2] - feet, axis=2).min(axis=1)
    return bool(away_m.max() < SAME_PLACE_M)
