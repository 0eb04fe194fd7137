"""Plots of a report by matplotlib, as SVG that takes its text's colour from the page, light or dark: the errors of one
run, and how the numbers of several are distributed."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from io import StringIO
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from logs.explain.true_errors import TrueError
from world_models.words import count

if TYPE_CHECKING:
    from numpy.typing import NDArray

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


OUTCOMES = ("outcome", "verdict")
"""The field that distinguishes the missions, the first that there is."""
IN_NAME = ("seed",)
"""Is left out: a mission's name says it."""
UNITS: Mapping[str, tuple[str, float]] = {
    "error_m": ("error mm", 1e3), "track_m": ("track mm", 1e3), "_m_per_s": (" m/s", 1.0),
    "_rad": (" deg", math.degrees(1.0)), "_m": (" m", 1.0), "_s": (" s", 1.0), "_px": (" px", 1.0),
}
"""By the end of a field's name, the first that fits: how it is called, and by what its values are multiplied."""
MOST_KINDS, MOST_CHARACTERS = 12, 40
"""A text with more values than this, or a longer one, is no kind: it stands in the last columns, without a filter."""

Value = str | float | None


@dataclass(frozen=True, slots=True)
class Field:
    """One column.

    Attributes:
        label: its name, with the unit.
        values: a text, a number in that unit, or None where it is not known; one a mission.
        is_number: whether the values are numbers; is_whole: whether they are whole ones.
        kinds: how often each text came, the most frequent first; empty where there are too many of them.
    """

    label: str
    values: Sequence[Value]
    is_number: bool = False
    is_whole: bool = False
    kinds: Mapping[str, int] | None = None

    def cell(self, number: int) -> str:
        """The value of a mission, for a person."""
        value = self.values[number]
        if not isinstance(value, float):
            return value or ""
        if self.is_whole and value.is_integer():
            return str(int(value))
        return f"{value:.2f}" if value == 0.0 or 0.01 <= abs(value) < 1e3 else f"{value:.3g}"


def read_fields(results: Sequence[Mapping[str, Any]]) -> tuple[list[Field], dict[str, str]]:
    """The columns, the outcome first and long texts last; and what is the same of all missions, by label."""
    rows = [_flat(result) for result in results]
    columns: list[Field] = []
    same: dict[str, str] = {}
    for key in sorted(dict.fromkeys(key for row in rows for key in row), key=lambda key: key not in OUTCOMES):
        field = _field(key, [row.get(key) for row in rows])
        if key in IN_NAME or all(value is None for value in field.values):
            continue
        if len(rows) > 1 and key not in OUTCOMES and len(set(field.values)) == 1:
            same[field.label] = field.cell(0)
        else:
            columns.append(field)
    return sorted(columns, key=lambda one: not one.is_number and not one.kinds), same


def _flat(result: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Parts of parts as ``milestones refuted``; lists are left out, they are for the run's own report."""
    found: dict[str, Any] = {}
    for key, value in result.items():
        if isinstance(value, dict):
            found |= _flat(value, f"{before}{key} ")
        elif not isinstance(value, list):
            found[before + key] = value
    return found


def _field(key: str, values: Sequence[Any]) -> Field:
    known = [value for value in values if value is not None]
    if known and all(isinstance(value, int | float) and not isinstance(value, bool) for value in known):
        end, (word, factor) = next(((end, unit) for end, unit in UNITS.items() if key.endswith(end)), ("", ("", 1.0)))
        label = key.removesuffix(end).replace("_", " ") + word
        return Field(label, [_number(value, factor) for value in values], True, all(isinstance(v, int) for v in known))
    texts = [_text(value) for value in values]
    kinds = Counter(text for text in texts if text is not None)
    is_kind = len(kinds) <= MOST_KINDS and all(len(kind) <= MOST_CHARACTERS for kind in kinds)
    return Field(key.replace("_", " "), texts, kinds=dict(kinds.most_common()) if is_kind else None)


def _number(value: Any, factor: float) -> float | None:
    """None for what is not known, or no number at all."""
    try:
        number = math.nan if value is None else float(value) * factor
    except OverflowError:
        number = math.inf
    return None if math.isnan(number) else number


def _text(value: Any) -> str | None:
    return None if value is None else {True: "yes", False: "no"}[value] if isinstance(value, bool) else str(value)


def count_outcomes(columns: Sequence[Field]) -> Iterator[tuple[str, int]]:
    """How often each outcome came; nothing where no field tells of one."""
    if columns and columns[0].label in OUTCOMES and columns[0].kinds:
        yield from columns[0].kinds.items()


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
"""By outcome, the most frequent first; distinct for the colour-blind too (Paul Tol's)."""


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
