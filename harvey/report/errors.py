"""The plot of a report: how far off the belief was, against how sure it was, over the cycles."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from harvey.report.drawing import drawing, svg
from harvey.story.truth import TrueError

LEAST_M = 1e-4
"""What is less is drawn as this: the axis is logarithmic."""


def draw_errors(
    beliefs: Sequence[Mapping[str, Any]], errors: Sequence[TrueError], lost: Iterable[tuple[int, int]]
) -> str:
    """The place's standard deviation and, where it is known, its true error [m], as SVG. ``lost``: cycles from, to."""
    with drawing(9.0, 2.8) as figure:
        axes = figure.add_axes((0.08, 0.18, 0.9, 0.76))
        axes.set_yscale("log")
        for since, until in lost:
            axes.axvspan(since, until, color="#cc3311", alpha=0.2, linewidth=0)
        axes.step([one["cycle"] for one in beliefs], [max(LEAST_M, one["sigma"]) for one in beliefs], where="post",
                  color="#0077bb", linewidth=1.2, label="sigma, as it believed")
        if errors:
            axes.plot([one.cycle for one in errors], [max(LEAST_M, one.off_m) for one in errors], ".",
                      color="#009955", markersize=3.5, label="true error, as only the simulator knows")
        axes.set_xlabel("cycle")
        axes.set_ylabel("place [m]")
        axes.grid(alpha=0.3)
        axes.legend(loc="upper right", frameon=False, fontsize="small")
        return svg(figure)
