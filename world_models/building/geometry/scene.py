"""Model lines and surfaces of several locales in arrays, as the visibility computation takes them."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from world_models.building.geometry.faces import Face, Region, area_vectors
from world_models.building.geometry.landmarks import Edges, Landmark

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Scene:
    """N model lines, C landmark corners and M convex one-sided surfaces with up to K corners.

    Attributes:
        edges: all model lines.
        line_landmark, line_index: (N,) number of the landmark in the world, and of the line in the landmark.
        corners_world: (C, 3) landmark corners [m].
        corner_landmark, corner_index: (C,) number of the landmark in the world, and of the corner in the landmark.
        corner_lines: (C, L) indices, 0..N-1, of the lines that meet in the corner; padded with -1.
        polygons_world: (M, K, 3) counter-clockwise as seen from the visible side [m]; padded with the last corner.
        planes_world: (M, 4) unit normal towards the visible side, and offset [m].
        surface_face: (M,) number in the world of the face that the surface is a region of.
        line_locales, corner_locales, surface_locales: (.., 2) indices in ``locales``; twice the same where only one.
        locales: names, sorted.
        marks: the landmarks by their number in the world.
    """

    edges: Edges
    line_landmark: Ints
    line_index: Ints
    corners_world: Floats
    corner_landmark: Ints
    corner_index: Ints
    corner_lines: Ints
    polygons_world: Floats
    planes_world: Floats
    surface_face: Ints
    line_locales: Ints
    corner_locales: Ints
    surface_locales: Ints
    locales: tuple[str, ...]
    marks: Mapping[int, Landmark]


@dataclass(frozen=True, eq=False)
class LocaleGeometry:
    """The faces and landmarks of a locale, or those that it shares with one neighbour (around an open door).

    Attributes:
        locale: the locale that they belong to.
        neighbour: the second locale from which they are seen; None for those of one locale only.
        faces, landmarks: each with its number in the world, ascending.
    """

    locale: str
    neighbour: str | None
    faces: tuple[tuple[int, Face], ...]
    landmarks: tuple[tuple[int, Landmark], ...]

    @cached_property
    def scene(self) -> Scene:
        """Its model lines and surfaces as arrays; cached."""
        return build_scene(self.faces, self.landmarks)


def build_scene(faces: Sequence[tuple[int, Face]], landmarks: Sequence[tuple[int, Landmark]]) -> Scene:
    """A scene in the order given; each face and landmark comes with its number in the world."""
    marks = [mark for _, mark in landmarks]
    items: list[Face | Landmark] = [*(face for _, face in faces), *marks]
    names = sorted({name for item in items for name in (item.locale, item.neighbour) if name})
    place = {name: index for index, name in enumerate(names)}

    def locale_pairs(items: Sequence[Face | Landmark]) -> Ints:
        return np.array([(place[i.locale], place[i.neighbour or i.locale]) for i in items], np.int64).reshape(-1, 2)

    surfaces = [(number, face, region) for number, face in faces for region in (*face.front, *face.back)]
    polygons, normals = stack_regions([region for _, _, region in surfaces])
    lines, points = [len(mark.lines_world) for mark in marks], [len(mark.points_world) for mark in marks]
    numbers, mark_locales = np.array([number for number, _ in landmarks], np.int64), locale_pairs(marks)
    return Scene(
        edges=Edges.concatenate(mark.edges for mark in marks),
        line_landmark=np.repeat(numbers, lines),
        line_index=_count_up(lines),
        corners_world=np.concatenate([np.zeros((0, 3)), *(mark.points_world for mark in marks)]),
        corner_landmark=np.repeat(numbers, points),
        corner_index=_count_up(points),
        corner_lines=_corner_lines(marks),
        polygons_world=polygons,
        planes_world=np.column_stack([normals, np.sum(normals * polygons[:, 0], axis=1)]),
        surface_face=np.array([number for number, _, _ in surfaces], np.int64),
        line_locales=np.repeat(mark_locales, lines, axis=0),
        corner_locales=np.repeat(mark_locales, points, axis=0),
        surface_locales=locale_pairs([face for _, face, _ in surfaces]),
        locales=tuple(names),
        marks=dict(landmarks),
    )


def stack_regions(regions: Sequence[Region]) -> tuple[Floats, Floats]:
    """Polygons (m, k, 3) [m], padded with their last corners, and unit normals towards the visible side (m, 3)."""
    longest = max((len(region.polygon_world) for region in regions), default=4)
    polygons = [_pad_polygon(region.polygon_world, longest) for region in regions]
    normals = [area / np.linalg.norm(area) for area in area_vectors([region.polygon_world for region in regions])]
    return np.array(polygons, float).reshape(-1, longest, 3), np.array(normals, float).reshape(-1, 3)


def concatenate_scenes(parts: Sequence[Scene]) -> Scene:
    """One scene from several, in the order of the world, whatever the order of the parts."""
    if len(parts) == 1:
        return parts[0]
    names = tuple(sorted({name for part in parts for name in part.locales}))
    place = {name: index for index, name in enumerate(names)}
    renumbered = [np.array([place[name] for name in part.locales], np.int64) for part in parts]

    def concatenated(attribute: str) -> Any:
        return np.concatenate([getattr(part, attribute) for part in parts])

    def renumbered_locales(attribute: str) -> Any:
        return np.concatenate([new[getattr(part, attribute)] for part, new in zip(parts, renumbered, strict=True)])

    edges = Edges.concatenate(part.edges for part in parts)
    lines = np.argsort(concatenated("line_landmark"), kind="stable")
    corners = np.argsort(concatenated("corner_landmark"), kind="stable")
    surfaces = np.argsort(concatenated("surface_face"), kind="stable")
    return Scene(
        edges=Edges(edges.lines_world[lines], edges.normals_world[lines], edges.brightness[lines]),
        line_landmark=concatenated("line_landmark")[lines],
        line_index=concatenated("line_index")[lines],
        corners_world=concatenated("corners_world")[corners],
        corner_landmark=concatenated("corner_landmark")[corners],
        corner_index=concatenated("corner_index")[corners],
        corner_lines=_renumber_corner_lines(parts, lines)[corners],
        polygons_world=_concatenate_polygons([part.polygons_world for part in parts])[surfaces],
        planes_world=concatenated("planes_world")[surfaces],
        surface_face=concatenated("surface_face")[surfaces],
        line_locales=renumbered_locales("line_locales")[lines],
        corner_locales=renumbered_locales("corner_locales")[corners],
        surface_locales=renumbered_locales("surface_locales")[surfaces],
        locales=names,
        marks=dict(ChainMap(*(dict(part.marks) for part in parts))),
    )


def _renumber_corner_lines(parts: Sequence[Scene], order: Ints) -> Ints:
    """(C, L) indices of the lines that meet in each corner, after sorting by ``order``."""
    after = np.empty(len(order) + 1, np.int64)
    after[order], after[-1] = np.arange(len(order)), -1
    widest = max(part.corner_lines.shape[1] for part in parts)
    rows, before = [], 0
    for part in parts:
        known = part.corner_lines
        shifted = np.where(known < 0, -1, known + before)
        rows.append(np.column_stack([shifted, np.full((len(known), widest - known.shape[1]), -1)]))
        before += len(part.line_landmark)
    return np.asarray(after[np.concatenate(rows)])


def _concatenate_polygons(polygons: Sequence[Floats]) -> Floats:
    """(M, K, 3) from arrays of polygons with different numbers of corners."""
    longest = max(p.shape[1] for p in polygons)
    return np.concatenate([np.concatenate([p, np.repeat(p[:, -1:], longest - p.shape[1], axis=1)], axis=1)
                           if p.shape[1] < longest else p for p in polygons])


def _corner_lines(landmarks: Sequence[Landmark]) -> Ints:
    """(C, L) indices of the lines that meet in each corner of all landmarks, padded with -1."""
    rows, before = [], 0
    for mark in landmarks:
        rows += [before + lines for lines in mark.corner_lines()]
        before += len(mark.lines_world)
    widest = max((len(row) for row in rows), default=2)
    return np.array([np.pad(row, (0, widest - len(row)), constant_values=-1) for row in rows],
                    np.int64).reshape(-1, widest)


def _pad_polygon(polygon: Floats, length: int) -> Floats:
    """(length, 3): np.pad with the last corner, at a tenth of its time."""
    return np.concatenate([polygon, np.repeat(polygon[-1:], length - len(polygon), axis=0)])


def _count_up(counts: Sequence[int]) -> Ints:
    """0 .. count - 1 for each count, one after the other."""
    return np.concatenate([np.zeros(0, np.int64), *(np.arange(count) for count in counts)])
