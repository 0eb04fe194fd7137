"""How missions went, in words and as a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from harvey.tables import table
from harvey.tally import Row
from harvey.units import INCH_M, count

COLUMNS = ("seed", "outcome", "error mm", "inches", "milestones", "refuted", "sketches", "replans", "collisions",
           "path m", "robot s", "cycles", "wall s")


def millimetres(error_m: float) -> str:
    """An error in millimetres and inches."""
    return f"{error_m * 1000.0:.1f} mm ({error_m / INCH_M:.2f} inches)"


def one(row: Row, out: Path | None) -> str:
    """The summary of one mission."""
    lines = [
        f"{row.outcome}: {row.reason}",
        f"  final error   {millimetres(row.error_m)} from the goal",
        f"  milestones    {row.verified} verified, {row.refuted} refuted",
        f"  sketches      {count(row.sketches, 'plan sketch', 'plan sketches')}, {row.replans} of them superseded",
        f"  goals         {count(row.goals, 'top-level goal')}",
        f"  collisions    {row.collisions}",
        f"  way           {row.path_m:.1f} m in {row.time_s:.0f} s of the robot's time",
        f"  took          {row.wall_s:.1f} s for {count(row.cycles, 'cycle')}",
    ]
    if out is not None:
        lines += [f"  recording     {out / 'recording.rrd'}",
                  f"open it with    harvey view {out}", f"ask it with     harvey why {out}"]
    return "\n".join(lines)


def several(rows: Sequence[Row]) -> str:
    """A table, one row a seed, with a summary row."""
    cells = [_cells(row) for row in rows]
    return table(COLUMNS, [*cells, _total(rows)], last_is_summary=True)


def _cells(r: Row) -> tuple[str, ...]:
    return (
        str(r.seed), r.outcome, f"{r.error_m * 1000:.1f}", f"{r.error_m / INCH_M:.2f}", str(r.verified), str(r.refuted),
        str(r.sketches), str(r.replans), str(r.collisions), f"{r.path_m:.1f}", f"{r.time_s:.0f}", str(r.cycles),
        f"{r.wall_s:.1f}",
    )


def _total(rows: Sequence[Row]) -> tuple[str, ...]:
    reached = sum(1 for r in rows if r.reached)
    worst_m = max(r.error_m for r in rows)
    means = [math.fsum(values) / len(rows) for values in zip(*(_numbers(r) for r in rows), strict=True)]
    return (f"{len(rows)}", f"{reached} reached", f"<= {worst_m * 1000:.1f}", f"<= {worst_m / INCH_M:.2f}",
            *(f"{mean:.1f}" for mean in means[:4]), str(sum(r.collisions for r in rows)),
            *(f"{mean:.1f}" for mean in means[4:]))


def _numbers(r: Row) -> tuple[float, ...]:
    return r.verified, r.refuted, r.sketches, r.replans, r.path_m, r.time_s, r.cycles, r.wall_s
