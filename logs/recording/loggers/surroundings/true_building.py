"""Where the building truly differs from the robot's model: what is there besides, and what is gone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr

from logs.recording.board_mirror import Moment
from logs.recording.logger import Logger
from logs.recording.loggers.surroundings.building import light_colours, triangles
from logs.recording.palette import REJECTED, TRUE
from logs.recording.paths import TRUE_ADDED, TRUE_GONE
from logs.recording.stream import RecordingStream
from world_models.building.geometry.faces import Face, Region, area_vector

LINE_M = 0.015
"""Half the width of an outline."""


class TrueBuilding(Logger):
    """Logs the differences, where somebody knows them, when they change: solid with green edges, or red edges only."""

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        for difference in moment.differences[-1:]:
            _log_outlines(stream, f"{TRUE_ADDED}/edges", difference.added, TRUE)
            _log_outlines(stream, TRUE_GONE, difference.gone, REJECTED)
            _log_surfaces(stream, _regions(difference.added))


def _regions(faces: Sequence[Face]) -> list[Region]:
    return [region for face in faces for region in (*face.front, *face.back)]


def _log_outlines(stream: RecordingStream, path: str, faces: Sequence[Face], colour: tuple[int, int, int, int]) -> None:
    strips = [np.concatenate([r.polygon_world, r.polygon_world[:1]]).astype(np.float32) for r in _regions(faces)]
    stream.log(path, rr.LineStrips3D, strips=strips, colors=[colour] * len(strips), radii=[LINE_M] * len(strips))


def _log_surfaces(stream: RecordingStream, regions: Sequence[Region]) -> None:
    corners = [len(region.polygon_world) for region in regions]
    starts = np.cumsum([0, *corners])[:-1]
    faces = [triangles(1, k) + start for k, start in zip(corners, starts, strict=True)]
    normals = np.array([area_vector(region.polygon_world) for region in regions]).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    colours = light_colours(np.array([region.colour for region in regions]).reshape(-1, 3), normals)
    stream.log(
        TRUE_ADDED, rr.Mesh3D,
        vertex_positions=np.concatenate([np.zeros((0, 3)), *(r.polygon_world for r in regions)]).astype(np.float32),
        vertex_colors=np.repeat(colours, corners, axis=0),
        triangle_indices=np.concatenate([np.zeros((0, 3), np.uint32), *faces]).astype(np.uint32))


LOGGER = TrueBuilding
