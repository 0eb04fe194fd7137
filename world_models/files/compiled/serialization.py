"""Faces, landmarks and arrays as bytes for a compiled world; numbers keep every bit."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from world_models.building.geometry.faces import Face
from world_models.building.geometry.landmarks import Edges, Landmark
from world_models.building.geometry.regions import Region
from world_models.building.locale_source import LocaleGeometry
from world_models.frames import frozen

Floats = NDArray[np.float64]


def pack_array(array: Any) -> bytes:
    """Little-endian float64."""
    return np.ascontiguousarray(array, "<f8").tobytes()


def unpack_array(data: bytes, shape: tuple[int, ...]) -> Floats:
    """A read-only array of this shape. Raises ValueError where the bytes have another length."""
    return frozen(np.frombuffer(data, "<f8").reshape(shape))


def pack_geometry(geometry: LocaleGeometry) -> tuple[str, bytes]:
    """Names and properties as JSON, and all numbers in the same order as bytes."""
    faces = [[number, f.name, f.kind, f.parent, dict(f.properties), len(f.polygon_world),
              [_pack_region(r) for r in f.front], [_pack_region(r) for r in f.back]] for number, f in geometry.faces]
    marks = [[number, m.name, m.kind, m.source, len(m.edges)] for number, m in geometry.landmarks]
    arrays: list[Floats] = []
    for _, face in geometry.faces:
        arrays += [face.polygon_world, *(r.polygon_world for r in (*face.front, *face.back))]
    for _, mark in geometry.landmarks:
        arrays += [mark.edges.lines_world, mark.edges.normals_world, mark.edges.brightness]
    flat = np.concatenate([np.zeros(0), *(array.ravel() for array in arrays)])
    return json.dumps([faces, marks], separators=(",", ":")), pack_array(flat)


def _pack_region(r: Region) -> list[Any]:
    return [r.name, len(r.polygon_world), list(r.colour), r.texture, r.texture_scale_m, r.seed]


def unpack_geometry(locale: str, neighbour: str | None, rows: Iterable[tuple[str, bytes]]) -> LocaleGeometry:
    """The geometry of one or several rows: the model's, and those of details that were compiled with it.

    Raises:
        ValueError, TypeError, LookupError: the rows are not from :func:`pack_geometry`.
    """
    faces: list[tuple[int, Face]] = []
    marks: list[tuple[int, Landmark]] = []
    for words, numbers in rows:
        face_rows, mark_rows = json.loads(words)
        reader = _Reader(np.frombuffer(numbers, "<f8").astype(np.float64))
        for number, name, kind, parent, properties, corners, front, back in face_rows:
            polygon = reader.take(corners, 3)
            sides = [tuple(_unpack_region(row, reader) for row in side) for side in (front, back)]
            faces.append((number, Face(name, locale, polygon, kind, neighbour, parent, sides[0], sides[1], properties)))
        for number, name, kind, source, lines in mark_rows:
            edges = Edges(reader.take(lines, 2, 3), reader.take(lines, 2, 3), reader.take(lines, 3))
            marks.append((number, Landmark(name, locale, kind, edges, neighbour, source)))
    return LocaleGeometry(locale, neighbour, tuple(faces), tuple(marks))


def _unpack_region(row: list[Any], reader: _Reader) -> Region:
    name, corners, (red, green, blue), texture, scale_m, seed = row
    return Region(name, frozen(reader.take(corners, 3)), (red, green, blue), texture, scale_m, seed)


class _Reader:
    """Takes arrays from a flat array of numbers, one after the other."""

    def __init__(self, numbers: Floats) -> None:
        self._numbers, self._at = numbers, 0

    def take(self, *shape: int) -> Floats:
        size = int(np.prod(shape))
        part = self._numbers[self._at : self._at + size]
        self._at += size
        return part.reshape(shape)
