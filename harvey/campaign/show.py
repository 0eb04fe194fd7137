"""How far a campaign is: told from its files, while it runs or afterwards."""

from __future__ import annotations

import json
import math
from collections import Counter
from dataclasses import dataclass
from datetime import timedelta
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Any

from harvey.campaign.engine import CAMPAIGN
from harvey.campaign.results_file import KILLED, RESULT, RESULTS, read_results, read_times
from harvey.errors import BadInput
from logs.run_directory import RUNS
from logs.tables import table
from world_models.words import count

if TYPE_CHECKING:
    from collections.abc import Sequence

PICTURE = "progress.png"
RATE_OF = 50
"""The rate is that of so many of the newest cases."""
PAUSE_S = 600.0
"""After so long without a result the campaign is taken to have been stopped in between."""
MOST_KINDS = 12
"""A field of a result with more values than this is no table row."""
SIZE_IN, DOTS = (7.0, 4.0), 130


@dataclass(frozen=True, slots=True)
class Progress:
    """What the files of a campaign tell.

    Attributes:
        folder: where they are.
        about: as the engine described it.
        results: by case; given_up: kills by case.
        times: what was measured, in the order in which the cases were done.
    """

    folder: Path
    about: dict[str, Any]
    results: dict[int, dict[str, Any]]
    given_up: dict[int, int]
    times: list[dict[str, Any]]

    @property
    def total(self) -> int:
        return max(int(self.about.get("total", 0)), len(self.results))

    @property
    def done_at_s(self) -> list[float]:
        """When each case was done [s since the first], without pauses between the engine's runs."""
        at: list[float] = []
        for before, now in zip([None, *self.times], self.times, strict=False):
            step = 0.0 if before is None else max(0.0, now["at"] - before["at"])
            at.append((at[-1] if at else 0.0) + (step if step < PAUSE_S else 0.0))
        return at

    @property
    def rate_per_s(self) -> float:
        """Of the newest cases; NaN where there are too few."""
        at = self.done_at_s[-RATE_OF - 1:]
        return (len(at) - 1) / (at[-1] - at[0]) if len(at) > 1 and at[-1] > at[0] else math.nan

    @property
    def remaining_s(self) -> float:
        """At this rate; NaN where it is not known."""
        left = self.total - len(self.results) - len(self.given_up)
        return left / self.rate_per_s if left else 0.0


def find_campaign(text: str) -> Path:
    """The folder of a campaign: as it is, or under ``runs/`` or ``runs/experiments/``. Raises BadInput."""
    for path in (Path(text), RUNS / text, RUNS / "experiments" / text):
        if (path / RESULTS).is_file():
            return path
    raise BadInput(f"expected the directory of a campaign, with a {RESULTS}, got {text!r} (harvey run --seed 0..19 and"
                   " harvey experiment make them under runs/)")


def read_progress(folder: Path) -> Progress:
    """Read it; a campaign may be under way. Raises BadInput."""
    try:
        about = json.loads((folder / CAMPAIGN).read_text(encoding="utf-8"))
    except FileNotFoundError:
        about = {}
    except ValueError as error:
        raise BadInput(f"{folder / CAMPAIGN}: expected JSON, got: {error}") from None
    _, records = read_results(folder / RESULTS)
    return Progress(
        folder, about if isinstance(about, dict) else {},
        {case: record[RESULT] for case, record in records.items() if RESULT in record},
        {case: record[KILLED] for case, record in records.items() if RESULT not in record and KILLED in record},
        [record for record in read_times(folder) if isinstance(record.get("at"), float | int)])


def format_progress(progress: Progress) -> str:
    """For a terminal."""
    p, unit = progress, str(progress.about.get("unit", "case"))
    workers = sorted({str(record.get("worker")) for record in p.times})
    lines = [
        f"{p.about.get('name', p.folder)}: {len(p.results)} of {count(p.total, unit)} done"
        + (f", {len(p.given_up)} given up" if p.given_up else ""),
        f"  workers       {p.about.get('workers', 'not known')}; {len(workers)} have answered so far",
    ]
    if p.about.get("dashboard"):
        lines.append(f"  dashboard     {p.about['dashboard']}")
    if not math.isnan(p.rate_per_s):
        lines.append(f"  rate          {_rate(p.rate_per_s, unit)}, of the newest {min(RATE_OF, len(p.times) - 1)}")
    took = [float(record["took_s"]) for record in p.times if "took_s" in record]
    if took:
        lines.append(f"  a {unit} takes {math.fsum(took) / len(took):.1f} s on average, {max(took):.1f} s at most")
    if len(p.results) + len(p.given_up) < p.total:
        left = "not known yet" if math.isnan(p.remaining_s) else str(timedelta(seconds=round(p.remaining_s)))
        lines.append(f"  remaining     {left}")
    rows = _kinds(list(p.results.values()))
    if rows:
        lines += ["", table(("field", "value", "cases", "%"), rows)]
    lines += [f"case {case}: given up after {kills} kills" for case, kills in p.given_up.items()]
    return "\n".join(lines)


def _rate(per_s: float, unit: str) -> str:
    return f"{per_s:.1f} {unit}s a second" if per_s >= 1.0 else f"{per_s * 60.0:.1f} {unit}s a minute"


def _kinds(results: Sequence[dict[str, Any]]) -> list[tuple[str, str, str, str]]:
    """How often each value came, of the fields that are words or yes and no, and of few values."""
    rows = []
    for field in dict.fromkeys(key for result in results for key in result):
        values = [result[field] for result in results if field in result]
        if not all(isinstance(value, str | bool) for value in values):
            continue
        counted = Counter("yes" if v is True else "no" if v is False else v for v in values)
        if len(counted) <= MOST_KINDS and (len(counted) > 1 or field == "outcome"):
            rows += [(field, value, str(n), f"{100.0 * n / len(values):.1f}") for value, n in counted.most_common()]
    return rows


def draw_progress(progress: Progress) -> Path:
    """Draw how many cases were done when, by outcome where they have one; returns the picture (PNG)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=SIZE_IN, dpi=DOTS, layout="constrained")
    axes = figure.add_subplot()
    minutes = [at / 60.0 for at in progress.done_at_s]
    outcomes = [str(progress.results.get(r["case"], {}).get("outcome", "done")) for r in progress.times]
    for outcome, _ in Counter(outcomes).most_common():
        mine = [outcome == other for other in outcomes]
        axes.step([0.0, *minutes], [0, *accumulate(mine)], where="post", label=f"{outcome}: {sum(mine)}")
    axes.axhline(progress.total, color="#777777", linewidth=0.8, linestyle="--", label=f"all: {progress.total}")
    axes.set_title(str(progress.about.get("name", progress.folder)), fontsize=11)
    axes.set_xlabel("minutes of work")
    axes.set_ylabel(f"{progress.about.get('unit', 'case')}s")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False, fontsize=9)
    path = progress.folder / PICTURE
    figure.savefig(path, format="png")
    return path
