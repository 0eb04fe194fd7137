"""Charts of experiments, drawn with matplotlib in one style."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OURS, PEER, PAPER = "#1f6fb4", "#d9822b", "#777777"
"""Colours: blue for Harvey, orange for a peer, grey for the paper or a limit."""
SIZE_IN, DOTS = (7.0, 4.5), 130


@contextmanager
def chart(path: Path, title: str, x: str, y: str, size_in: tuple[float, float] = SIZE_IN) -> Iterator[Axes]:
    """Yield axes to draw on; at the end of the block they are written to ``path`` (PNG), with a legend if any."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=size_in, dpi=DOTS, layout="constrained")
    axes = figure.add_subplot()
    axes.set_title(title, fontsize=11)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(alpha=0.3)
    yield axes
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False, fontsize=9)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, format="png")
