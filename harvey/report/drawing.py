"""Plots of a report by matplotlib, as SVG that takes its text's colour from the page, light or dark."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from io import StringIO
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

METADATA = ("Date", "Creator", "Format", "Type")
"""Is left out: the same run gives the same bytes."""
INK = "#808080"
"""Of text and frame; the page's own colour stands in its place at the end."""
NUMBERED = re.compile(r' id="[\w.]+_\d+"')
"""Names of groups, which nothing refers to, and which each plot of a page would have again."""


@contextmanager
def drawing(width_in: float, height_in: float) -> Iterator[Figure]:
    """A figure to draw on, of this size [inches]; what is drawn has the page's colours within the context only."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context({"svg.hashsalt": "harvey", "svg.fonttype": "none", "text.color": INK, "axes.labelcolor": INK,
                     "xtick.color": INK, "ytick.color": INK, "axes.edgecolor": INK}):
        yield Figure(figsize=(width_in, height_in))


def svg(figure: Figure) -> str:
    """The figure as an element of a page."""
    out = StringIO()
    figure.savefig(out, format="svg", transparent=True, metadata=dict.fromkeys(METADATA))
    text = out.getvalue()
    return NUMBERED.sub("", text[text.index("<svg"):]).replace(INK, "currentColor")
