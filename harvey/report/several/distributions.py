"""Plots of a report of several missions: how its numbers are distributed, by outcome."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from harvey.report.drawing import drawing, svg
from harvey.report.several.fields import Field, count_outcomes
from world_models.words import count

if TYPE_CHECKING:
    from numpy.typing import NDArray

FIRST = ("error", "time", "cpu", "probes", "frames", "collisions")
"""What is drawn first, by a word of its label."""
MOST_PLOTS = 8
MOST_WHOLE = 30
"""Whole numbers within so many have a bar each."""
BINS = 24
LOG_RATIO = 100.0
"""Where the largest is so many times the smallest, the axis is logarithmic."""
PERCENTILE = 95
COLOURS = ("#0077bb", "#cc3311", "#ee7733", "#aa3377", "#33bbee", "#009988", "#bbbbbb")
"""By outcome, the most frequent first; to be told apart by the colour-blind too (Paul Tol's)."""


def draw_distributions(columns: Sequence[Field]) -> Iterator[tuple[str, str]]:
    """A histogram of each number, as SVG, and in words; the most telling ones."""
    def place(field: Field) -> int:
        return next((n for n, word in enumerate(FIRST) if word in field.label), len(FIRST))

    outcomes = [kind for kind, _ in count_outcomes(columns)]
    groups = columns[0].values if outcomes else [""] * len(columns[0].values if columns else ())
    for field in sorted((one for one in columns if one.is_number), key=place)[:MOST_PLOTS]:
        numbers = np.array([math.nan if value is None else value for value in field.values], float)
        if np.isfinite(numbers).sum() > 1:
            yield _draw(field, numbers, groups, outcomes or [""]), _describe(field, numbers)


def _draw(field: Field, numbers: NDArray[np.float64], groups: Sequence[object], outcomes: Sequence[str]) -> str:
    from matplotlib.ticker import MaxNLocator

    with drawing(4.6, 2.9) as figure:
        axes = figure.add_axes((0.13, 0.19, 0.84, 0.77))
        finite = np.isfinite(numbers)
        edges, is_log = _edges(numbers[finite], whole=field.is_whole)
        parts = [numbers[finite & np.array([group == outcome for group in groups])] for outcome in outcomes]
        shown = [number for number, part in enumerate(parts) if len(part)]
        axes.hist([parts[n] for n in shown], bins=list(edges), stacked=True, label=[outcomes[n] for n in shown],
                  color=[COLOURS[n % len(COLOURS)] for n in shown])
        if field.is_whole:
            axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        if is_log:
            axes.set_xscale("log")
        axes.set_xlabel(field.label)
        axes.set_ylabel("missions")
        axes.yaxis.set_major_locator(MaxNLocator(integer=True))
        axes.grid(alpha=0.3)
        if len(outcomes) > 1:
            axes.legend(frameon=False, fontsize="small")
        return svg(figure)


def _edges(numbers: NDArray[np.float64], *, whole: bool) -> tuple[NDArray[np.float64], bool]:
    """The bins, and whether they are wider the further right they stand."""
    least, most = float(numbers.min()), float(numbers.max())
    if whole and most - least <= MOST_WHOLE:
        return np.arange(least - 0.5, most + 1.0), False
    if least > 0.0 and most > LOG_RATIO * least:
        return np.geomspace(least, most, BINS + 1), True
    return np.histogram_bin_edges(numbers, BINS), False


def _describe(field: Field, numbers: NDArray[np.float64]) -> str:
    """``error mm: median 3.38, 95 % at most 4.2, worst 5.0; of 20 missions``."""
    known = np.sort(numbers[~np.isnan(numbers)])
    figures = (float(np.median(known)), float(known[math.ceil(PERCENTILE / 100 * len(known)) - 1]), float(known[-1]))
    shown = Field(field.label, figures, is_whole=field.is_whole)
    left_out = len(numbers) - int(np.isfinite(numbers).sum())
    more = f"; not drawn: {left_out}, not known or without end" if left_out else ""
    return (f"{field.label}: median {shown.cell(0)}, {PERCENTILE} % at most {shown.cell(1)}, greatest {shown.cell(2)};"
            f" of {count(len(known), 'mission')}{more}")
