"""The world's model lines and surfaces laid out in arrays, as the visibility computation wants them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from world_models.faces import Face, area_vector
from world_models.landmarks import Edges, Landmark
from world_models.regions import Region


@dataclass(frozen=True, eq=False)
class Scene:
    """N model lines, C corners and M convex one-sided surfaces with up to K corners.

    Attributes:
        edges: all model lines.
        line_landmark, line_index: (N,) which line of which landmark.
        corners_world: (C, 3) landmark corners [m].
        corner_landmark, corner_index: (C,) which corner of which landmark.
        corner_lines: (C, L) the lines (numbers among all N) that meet in it; -1 pads.
        polygons_world: (M, K, 3) counter-clockwise from the visible side; short ones repeat their last corner.
        planes_world: (M, 4) unit normal towards the visible side, and offset.
        line_locales, corner_locales, surface_locales: (.., 2) numbers in ``locales``, twice the same where only one.
        locales: names.
    """

    edges: Edges
    line_landmark: NDArray[np.int64]
    line_index: NDArray[np.int64]
    corners_world: NDArray[np.float64]
    corner_landmark: NDArray[np.int64]
    corner_index: NDArray[np.int64]
    corner_lines: NDArray[np.int64]
    polygons_world: NDArray[np.float64]
    planes_world: NDArray[np.float64]
    line_locales: NDArray[np.int64]
    corner_locales: NDArray[np.int64]
    surface_locales: NDArray[np.int64]
    locales: tuple[str, ...]


def build_scene(faces: Sequence[Face], landmarks: Sequence[Landmark]) -> Scene:
    """Arrays of everything, in the order given."""
    names = sorted({face.locale for face in faces} | {mark.locale for mark in landmarks})
    surfaces = [(face, region) for face in faces for region in (*face.front, *face.back)]
    polygons = _padded([region for _, region in surfaces])
    lines, points = [len(mark.lines_world) for mark in landmarks], [len(mark.points_world) for mark in landmarks]
    rooms = np.array([_numbers(names, mark.locale, mark.neighbour) for mark in landmarks], np.int64).reshape(-1, 2)
    normals = np.array([_unit(area_vector(region.polygon_world)) for _, region in surfaces]).reshape(-1, 3)
    return Scene(
        edges=Edges.joined(mark.edges for mark in landmarks),
        line_landmark=np.repeat(np.arange(len(landmarks)), lines),
        line_index=_counts_up(lines),
        corners_world=np.concatenate([np.zeros((0, 3)), *(mark.points_world for mark in landmarks)]),
        corner_landmark=np.repeat(np.arange(len(landmarks)), points),
        corner_index=_counts_up(points),
        corner_lines=_meeting_lines(landmarks),
        polygons_world=polygons,
        planes_world=np.column_stack([normals, np.sum(normals * polygons[:, 0], axis=1)]),
        line_locales=np.repeat(rooms, lines, axis=0),
        corner_locales=np.repeat(rooms, points, axis=0),
        surface_locales=np.array([_numbers(names, face.locale, face.neighbour) for face, _ in surfaces],
                                 np.int64).reshape(-1, 2),
        locales=tuple(names),
    )


def _meeting_lines(landmarks: Sequence[Landmark]) -> NDArray[np.int64]:
    rows, before = [], 0
    for mark in landmarks:
        rows += [before + mark.corner_lines(point) for point in range(len(mark.points_world))]
        before += len(mark.lines_world)
    widest = max((len(row) for row in rows), default=2)
    return np.array([np.pad(row, (0, widest - len(row)), constant_values=-1) for row in rows],
                    np.int64).reshape(-1, widest)


def _padded(regions: Sequence[Region]) -> NDArray[np.float64]:
    longest = max((len(region.polygon_world) for region in regions), default=4)
    padded = [np.pad(r.polygon_world, ((0, longest - len(r.polygon_world)), (0, 0)), "edge") for r in regions]
    return np.array(padded, float).reshape(-1, longest, 3)


def _counts_up(counts: Sequence[int]) -> NDArray[np.int64]:
    return np.concatenate([np.zeros(0, np.int64), *(np.arange(count) for count in counts)])


def _numbers(names: Sequence[str], locale: str, neighbour: str | None) -> tuple[int, int]:
    return names.index(locale), names.index(neighbour if neighbour in names else locale)


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    return vector / np.linalg.norm(vector)
