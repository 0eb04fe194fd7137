"""The corridor's model laid over the photographs: as it was believed, and as it was found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.collections import LineCollection
from numpy.typing import NDArray

from experiments.chart import OURS, PEER, chart
from experiments.perception.corridor_data import Corridor
from experiments.perception.corridor_trials import Attempt, disturbed, found_from, in_view

Array = NDArray[np.float64]
SIZE_IN = (7.0, 7.3)


def draw_attempt(data: Corridor, attempt: Attempt, path: Path) -> None:
    """The photograph with the model from the disturbed pose (orange) and from the pose found (blue)."""
    frame = data.frames[attempt.frame]
    prior, rng = disturbed(attempt)
    found = found_from(attempt.frame, prior, rng)
    said = "nothing found" if found is None else found.verdict.value
    with chart(path, f"Frame {attempt.frame}, {attempt.test.name}: {said}", "u [px]", "v [px]", SIZE_IN) as axes:
        axes.grid(visible=False)
        axes.imshow(frame.image, cmap="gray", vmin=0, vmax=255)
        axes.add_collection(_lines(in_view(data.model_lines, frame, prior)[1], PEER, "model as believed"))
        if found is not None:
            shown = in_view(data.model_lines, frame, found.camera_from_world)[1]
            axes.add_collection(_lines(shown, OURS, "model as found"))


def _lines(segments_px: Array, colour: str, label: str) -> LineCollection:
    return LineCollection(list(segments_px), colors=colour, linewidths=1.0, label=label)
