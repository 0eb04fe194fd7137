"""One sheet with the same two views under every kind of light."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.generated.light import LIGHT_KINDS, LightKind, draw_light
from knowledge_sources.methods.features.picture import read_picture
from sim.scenario import load_scenario, with_settings
from sim.stage import build_stage
from world_models.frames import Pose2

SCENARIO = "lab-to-allens-office"
VIEWS = (Pose2(16.6, -4.0, 2.5), Pose2(9.0, 1.0, 0.0))
"""In an office, and along the hallway."""
SEED = 192
"""Of the light; a development seed with sun on the office's windows."""
ACROSS = 5


def draw_sheet(path: Path, seed: int = SEED) -> None:
    """Write the sheet (PNG): five lights in a row, with both views of each below one another."""
    from matplotlib.figure import Figure

    rows = -(-len(LIGHT_KINDS) // ACROSS)
    figure = Figure(figsize=(3.0 * ACROSS, 6.2 * rows), dpi=100, layout="constrained")
    for axes, kind in zip(np.ravel(figure.subplots(rows, ACROSS)), LIGHT_KINDS, strict=False):
        axes.imshow(_tile(kind, seed))
        axes.set_title(kind, fontsize=11)
    for axes in figure.axes:
        axes.set_axis_off()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, format="png")


def _tile(kind: LightKind, seed: int) -> NDArray[np.uint8]:
    """(height, width, 3) both views, the second below the first."""
    values = draw_light(kind, seed) or {}
    scenario = with_settings(load_scenario(SCENARIO), {f"light.{key}": value for key, value in values.items()})
    body = build_stage(scenario).body(seed)
    pictures = []
    for view in VIEWS:
        body.put_robot(view)
        pictures.append(read_picture(body.look().jpeg).color)
    return np.asarray(np.vstack(pictures), np.uint8)
