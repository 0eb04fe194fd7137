"""Report of an experiment: a table with notes and claims, printed as text or JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any, Literal

from logs.tables import table

if TYPE_CHECKING:
    from matplotlib.axes import Axes


WIDTH = 120
Cell = str | int | float | None
"""None, shown as a dash: not measured."""
Finding = Literal["proved", "not contradicted", "fails"]
"""Of a claim: its 95 % bound proves it; what was measured agrees, and is too little to prove it; it does not agree."""
Claim = tuple[str, bool | Finding]
"""A statement, and what was found. True: all that it speaks of was measured, and agrees; False: it fails."""

SIDES: Mapping[str, tuple[str, ...]] = {
    "paper": ("paper", "literature"), "peer": ("peer", "py_trees", "clips", "networkx"), "ours": (),
}
"""Source of a column's figures by a word in its name; ours if it has none of these."""


@dataclass(frozen=True, slots=True)
class Report:
    """A table of measurements with its assumptions.

    Attributes:
        title: the quantity measured.
        columns: names of the columns; by convention what, paper, peer, ours.
        rows: as many cells each.
        notes: assumptions, and the meaning of the figures.
        claims: statements that must hold, each with what was found.
        is_small: it is of a smaller version of the experiment, which alone proves nothing that has no bound.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    notes: tuple[str, ...] = ()
    claims: tuple[Claim, ...] = ()
    is_small: bool = False

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(f"expected {len(self.columns)} cells for {self.columns}, got {row}")

    @property
    def holds(self) -> bool:
        """Whether no claim fails."""
        return not self.failing

    @property
    def findings(self) -> tuple[tuple[str, Finding], ...]:
        """Each claim with one of the three words."""
        return tuple((claim, _find(found, self.is_small)) for claim, found in self.claims)

    @property
    def failing(self) -> tuple[str, ...]:
        """The claims that fail."""
        return tuple(claim for claim, found in self.findings if found == "fails")

    def text(self) -> str:
        """The report as text for a terminal."""
        shown = table(self.columns, [[format_cell(cell) for cell in row] for row in self.rows])
        claims = [f"{'FAILS' if found == 'fails' else found}: {claim}" for claim, found in self.findings]
        words = [fill(line, WIDTH, subsequent_indent="  ") for line in (*self.notes, *claims)]
        return "\n".join([self.title, "", shown, *([""] if words else []), *words])

    def record(self) -> Mapping[str, Any]:
        """The report as JSON types: each row has its cells by column name, and ``paper``, ``peer`` and ``ours``.

        Each of these three is one figure, several figures by column name, or null.
        """
        return {
            "title": self.title,
            "rows": [self._row(dict(zip(self.columns, row, strict=True))) for row in self.rows],
            "notes": list(self.notes),
            "claims": [{"claim": claim, "found": found} for claim, found in self.findings],
        }

    def _row(self, cells: Mapping[str, Cell]) -> Mapping[str, Any]:
        what, *measured = self.columns
        sides: dict[str, dict[str, Cell]] = {side: {} for side in SIDES}
        for column in measured:
            sides[_side_of(column)][column] = cells[column]
        return {"what": cells[what], **{side: _unpack_single(figures) for side, figures in sides.items()}, **cells}


def _find(found: bool | Finding, is_small: bool) -> Finding:
    if isinstance(found, str):
        return found
    if not found:
        return "fails"
    return "not contradicted" if is_small else "proved"


def count_kinds(kinds: Iterable[str]) -> str | None:
    """Count equal words for a cell: ``"2 lost, 1 blocked"``; None if there are none."""
    counts = sorted(Counter(kinds).items())
    return ", ".join(f"{number} {kind}" for kind, number in counts) or None


def format_triple(values: Iterable[float]) -> str:
    """Format three figures for one cell: ``"0.80  -0.23  0.20"``."""
    return "  ".join(f"{value:.2f}" for value in values)


def _side_of(column: str) -> str:
    name = column.lower()
    return next((side for side, words in SIDES.items() if any(word in name for word in words)), "ours")


def _unpack_single(figures: Mapping[str, Cell]) -> Cell | Mapping[str, Cell]:
    return dict(figures) if len(figures) > 1 else next(iter(figures.values()), None)


def format_cell(cell: Cell) -> str:
    """A cell for a person: four digits, a dash for what was not measured."""
    if cell is None:
        return "-"
    if not isinstance(cell, float):
        return str(cell)
    return f"{cell:.0f}" if 1e4 <= abs(cell) < 1e9 else f"{cell:.4g}"


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
