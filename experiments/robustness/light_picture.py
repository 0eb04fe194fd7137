"""One sheet with the same two views under every kind of light."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.made_up.lights import LIGHT_KINDS, LightKind, draw_light
from sim.scenario import load_scenario, with_settings
from sim.stage import build_stage
from world_models.frames import Pose2

SCENARIO = "lab-to-allens-office"
VIEWS = (Pose2(16.6, -4.0, 2.5), Pose2(9.0, 1.0, 0.0))
"""In an office, and along the hallway."""
SEED = 192
"""Of the light; a development seed with sun on the office's windows."""
ACROSS, WIDTH_PX = 5, 300


def draw_sheet(path: Path, seed: int = SEED) -> None:
    """Write the sheet (PNG): five lights in a row, with both views of each below one another."""
    tiles = [_tile(kind, seed) for kind in LIGHT_KINDS]
    rows = [np.hstack(tiles[i : i + ACROSS]) for i in range(0, len(tiles), ACROSS)]
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), np.vstack(rows))


def _tile(kind: LightKind, seed: int) -> NDArray[np.uint8]:
    values = draw_light(kind, seed) or {}
    scenario = with_settings(load_scenario(SCENARIO), {f"light.{key}": value for key, value in values.items()})
    stage = build_stage(scenario)
    pictures = []
    for view in VIEWS:
        body = stage.body(seed)
        body.put_robot(view)
        picture = cv2.imdecode(np.frombuffer(body.look().jpeg, np.uint8), cv2.IMREAD_COLOR)
        assert picture is not None
        pictures.append(cv2.resize(picture, (WIDTH_PX, WIDTH_PX), interpolation=cv2.INTER_AREA))
    tile = np.vstack(pictures)
    cv2.rectangle(tile, (0, 0), (12 + 9 * len(kind), 22), (0, 0, 0), cv2.FILLED)
    cv2.putText(tile, kind, (5, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255), 1, cv2.LINE_AA)
    return np.asarray(tile, np.uint8)
