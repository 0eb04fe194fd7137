"""The corridor photographs with their surveyed lines (Oxford VGG)."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.shared_data import CORRIDOR, data_path
from harvey.errors import BadInput
from knowledge_sources.methods.features.picture import read_picture
from world_models.camera import Camera
from world_models.frames import Pose

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class CorridorFrame:
    """A photograph (h, w), its camera, its reference pose and its publishers' segments (k, 2, 2)."""

    image: NDArray[np.uint8]
    camera: Camera
    camera_from_world: Pose
    segments_px: Array


@dataclass(frozen=True, slots=True, eq=False)
class Corridor:
    """Model lines (m, 2, 3) in the survey's own unit of length, and the frames."""

    model_lines: Array
    frames: tuple[CorridorFrame, ...]

    @property
    def step(self) -> float:
        """Mean distance of the camera between frames."""
        places = np.array([frame.camera_from_world.inverse().translation for frame in self.frames])
        return float(np.mean(np.linalg.norm(np.diff(places, axis=0), axis=1)))


def load_corridor(folder: Path | None = None) -> Corridor | None:
    """Load the data; ``None`` if there are none.

    Raises:
        BadInput: the file is there but is not what it should be.
    """
    folder = folder or data_path(CORRIDOR)
    path = folder / "corridor.json"
    if not path.is_file():
        return None
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        model = np.asarray(data["model_lines"], float).reshape(-1, 2, 3)
        frames = tuple(_frame(folder, entry) for entry in data["frames"])
    except KeyError as missing:
        raise BadInput(f"{path}: expected a key {missing}, there is none") from None
    except (ValueError, TypeError, OSError) as wrong:
        raise BadInput(f"{path}: expected lines and frames of the corridor, got {wrong}") from None
    if len(frames) < 2:
        raise BadInput(f"{path}: expected at least 2 frames, got {len(frames)}")
    return Corridor(model, frames)


def _frame(folder: Path, entry: Mapping[str, Any]) -> CorridorFrame:
    pose = entry["camera_from_world"]
    return CorridorFrame(
        read_picture((folder / entry["image"]).read_bytes()).grey,
        Camera(*(entry[name] for name in ("fx", "fy", "cx", "cy", "width", "height"))),
        Pose(np.asarray(pose["rotation"], float), np.asarray(pose["translation"], float)),
        np.asarray(entry["segments"], float).reshape(-1, 2, 2),
    )
