"""How missions went, in words and as a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from logs.tables import table
from world_models.units import FOOT_M, INCH_M
from world_models.words import count, degrees

if TYPE_CHECKING:
    from harvey.dry_run import MilestonePreview
    from harvey.runner.result import MissionResult
    from world_models.entries import Outcome

COLUMNS = ("seed", "outcome", "error mm", "inches", "milestones", "refuted", "wrong", "sketches", "replans",
           "relocated", "collisions", "path m", "robot s", "cycles", "wall s")


def format_error(error_m: float) -> str:
    """An error in millimetres and inches; beyond a metre in metres and feet; NaN is not known."""
    if math.isnan(error_m):
        return "not known"
    if abs(error_m) > 1.0:
        return f"{error_m:.2f} m ({error_m / FOOT_M:.1f} feet)"
    return f"{error_m * 1000.0:.1f} mm ({error_m / INCH_M:.2f} inches)"


def format_result(r: MissionResult, out: Path | None, story: Sequence[str] = ()) -> str:
    """The summary of one mission; ``story``: the first lines of its story."""
    m = r.milestones
    lines = [
        f"{r.outcome}: {r.reason}",
        f"  final error   {format_error(r.error_m)} from the goal, {degrees(r.final_heading_error_rad or 0.0)} off",
        f"  milestones    {m['verified']} verified, {m['refuted']} refuted, {m['not_testable']} not testable,"
        f" {m['false_accepts']} accepted wrongly",
        f"  plans         {count(r.sketches, 'sketch', 'sketches')}, {count(r.replans, 'replan')},"
        f" {count(r.relocalizations, 'relocalization')}",
        f"  collisions    {r.collisions}",
        *(f"  camera        {lesson.text()}" for lesson in r.camera),
        *(f"  amiss         {text}" for text in r.amiss),
        *(f"  starved       {text}" for text in r.starved),
        f"  way           {r.path_length_m:.1f} m in {r.sim_time_s:.0f} s of the robot's time",
        f"  took          {r.wall_time_s:.1f} s for {count(r.cycles, 'cycle')} and {count(r.frames, 'picture')}, with"
        f" {count(r.waits, 'more cycle')} to ask for locale frames",
    ]
    if out is not None:
        lines.append(f"  recording     {out / 'recording.rrd'}")
    lines += ["", *story] if story else []
    if out is not None:
        lines += ["", f"open it with    harvey view {out}", f"have it told    harvey story {out}",
                  f"ask it with     harvey why {out}"]
    return "\n".join(lines)


def format_results(results: Sequence[MissionResult]) -> str:
    """A table, one row a seed, with a summary row."""
    rows = table(COLUMNS, [*(_cells(r) for r in results), _total(results)], last_is_summary=True)
    return "\n".join([rows, *(f"seed {r.seed}: {text}" for r in results for text in (*r.amiss, *r.starved))])


def format_previews(ahead: Sequence[MilestonePreview]) -> str:
    """The milestones to come, one a row."""
    columns = ("milestone", "in", "x m", "y m", "looking", "landmarks", "lines", "place mm", "heading deg",
               "p wrong", "verdict")
    return table(columns, [_preview(p) for p in ahead])


def summarize_dry_run(ahead: Sequence[MilestonePreview], outcome: Outcome) -> tuple[str, bool]:
    """How the dry run of a mission ends, and whether nothing speaks against driving it.

    A dry run verifies every milestone, so reaching the goal says little where one is not testable or ambiguous.
    """
    doubtful = [(verdict, sum(1 for p in ahead if p.verdict == verdict)) for verdict in ("not testable", "ambiguous")]
    doubts = [f"{count(number, 'milestone')} {verdict}" for verdict, number in doubtful if number]
    weak = sum(1 for p in ahead if p.verdict == "weak")
    if outcome.kind == "reached" and doubts:
        return f"may not reach its goal: of {len(ahead)} on the way, {' and '.join(doubts)}", False
    if outcome.kind == "reached":
        return f"ends: reached, {outcome.reason}" + (f"; {count(weak, 'milestone')} weak" if weak else ""), True
    return f"ends: {outcome.kind}, {outcome.reason}" + (f"; {' and '.join(doubts)}" if doubts else ""), False


def _preview(p: MilestonePreview) -> tuple[str, ...]:
    return (p.what, p.locale, f"{p.x_m:.2f}", f"{p.y_m:.2f}", f"{math.degrees(p.look_heading_rad):.0f}",
            str(p.landmarks), str(p.lines), f"{p.sigma_m * 1000:.1f}", f"{math.degrees(p.sigma_rad):.2f}",
            f"{p.p_false:.1g}", f"{p.verdict}: {p.alike} looks like it" if p.alike else p.verdict)


def _cells(r: MissionResult) -> tuple[str, ...]:
    counts, ways = _counts(r), _ways(r)
    return (str(r.seed), r.outcome, f"{r.error_m * 1000:.1f}", f"{r.error_m / INCH_M:.2f}",
            *(str(n) for n in counts), f"{ways[0]:.1f}", f"{ways[1]:.0f}", f"{ways[2]:.0f}", f"{ways[3]:.1f}")


def _counts(r: MissionResult) -> tuple[int, ...]:
    m = r.milestones
    return (m["verified"] or 0, m["refuted"] or 0, r.false_accepts, r.sketches, r.replans, r.relocalizations,
            r.collisions or 0)


def _ways(r: MissionResult) -> tuple[float, ...]:
    return r.path_length_m, r.sim_time_s, r.cycles, r.wall_time_s


def _total(results: Sequence[MissionResult]) -> tuple[str, ...]:
    """Counts are summed, ways averaged, of errors the worst is told."""
    reached = sum(1 for r in results if r.outcome == "reached")
    worst_m = max(r.error_m for r in results)
    sums = [sum(values) for values in zip(*(_counts(r) for r in results), strict=True)]
    means = [math.fsum(values) / len(results) for values in zip(*(_ways(r) for r in results), strict=True)]
    return ("all", f"{reached} of {len(results)} reached", f"max {worst_m * 1000:.1f}", f"{worst_m / INCH_M:.2f}",
            *(str(n) for n in sums), f"{means[0]:.1f}", f"{means[1]:.0f}", f"{means[2]:.0f}", f"{means[3]:.1f}")
