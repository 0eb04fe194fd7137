"""The corridor's model over the photographs: from the perturbed pose and from the pose found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.collections import LineCollection
from numpy.typing import NDArray

from experiments.chart import OURS, PEER, chart
from experiments.perception.photographs.data import Corridor
from experiments.perception.photographs.trials import Attempt, locate_from, perturb_reference, select_visible

Array = NDArray[np.float64]
SIZE_IN = (7.0, 7.3)


def draw_attempt(data: Corridor, attempt: Attempt, path: Path) -> None:
    """Draw a photograph with the model from the perturbed pose (orange) and from the pose found (blue)."""
    frame = data.frames[attempt.frame]
    prior, rng = perturb_reference(attempt)
    found = locate_from(attempt.frame, prior, rng)
    verdict = "no pose found" if found is None else found.verdict.value
    with chart(path, f"Frame {attempt.frame}, {attempt.test.name}: {verdict}", "u [px]", "v [px]", SIZE_IN) as axes:
        axes.grid(visible=False)
        axes.imshow(frame.image, cmap="gray", vmin=0, vmax=255)
        perturbed = select_visible(data.model_lines, frame, prior)[1]
        axes.add_collection(_lines(perturbed, PEER, "model at the perturbed pose"))
        if found is not None:
            shown = select_visible(data.model_lines, frame, found.camera_from_world)[1]
            axes.add_collection(_lines(shown, OURS, "model at the pose found"))


def _lines(segments_px: Array, colour: str, label: str) -> LineCollection:
    return LineCollection(list(segments_px), colors=colour, linewidths=1.0, label=label)
