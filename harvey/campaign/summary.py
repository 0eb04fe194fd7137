"""What is said of missions: how far one is, meanwhile; and how they went, in words and as a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from tqdm import tqdm

from blackboard import Decision
from harvey.runner.result import MissionResult, format_error
from logs.explain.turning_points import TurningPointFinder
from logs.tables import table
from world_models.entries import Goal, Hypothesis, Milestone
from world_models.units import INCH_M
from world_models.words import count, degrees

if TYPE_CHECKING:
    from sim.stage import Stage

COLUMNS = ("seed", "outcome", "error mm", "inches", "milestones", "refuted", "wrong", "sketches", "replans",
           "relocated", "collisions", "path m", "robot s", "cycles", "wall s")


class ProgressLine:
    """A sink that shows how far a mission is, by Harvey's own belief.

    On a terminal it is a bar that fills as the way to go shrinks. Elsewhere it is a line whenever a milestone is
    verified, and at each turning point that must not be left out.

    Attributes:
        verified: milestones so far.
        to_go_m: distance to the goal as the crow flies.
        is_lost: whether the robot does not know where it is.
    """

    def __init__(self, stage: Stage, out: TextIO) -> None:
        self._world, self._goal, self._out = stage.world, stage.goal_world, out
        self.verified, self.is_lost = 0, False
        self.to_go_m = self._way_m = stage.start_world.distance_to(stage.goal_world)
        self._finder = TurningPointFinder()
        self._bar = tqdm(total=self._way_m, file=out, leave=False, dynamic_ncols=True, disable=not out.isatty(),
                         bar_format="{percentage:3.0f} %|{bar}| {desc} [{elapsed}]")

    def __call__(self, decision: Decision) -> None:
        before = self.verified
        for point in self._finder.find(decision):
            if point.is_main:
                self.is_lost = point.kind == "lost" or (self.is_lost and point.kind != "found")
                self._print(f"cycle {point.cycle}: {point.kind}: {point.text}")
        for change in decision.made:
            value = change.entry.value
            if isinstance(value, Milestone):
                self.verified += value.status == "verified"
            elif isinstance(value, Goal) and value.is_active:
                self._goal = value.destination.in_world(self._world)
            elif isinstance(value, Hypothesis) and value.is_held:
                self.to_go_m = value.world_from_robot(self._world).distance_to(self._goal)
        verified = f"{count(self.verified, 'milestone')} verified"
        if self.verified > before:
            self._print(f"cycle {decision.cycle}: {verified}, {self.to_go_m:.1f} m to go")
        self._bar.n = min(max(0.0, self._way_m - self.to_go_m), self._way_m)
        line = f"{self.to_go_m:.1f} m to go, {verified}, cycle {decision.cycle}{', lost' * self.is_lost}"
        self._bar.set_description_str(line, refresh=False)
        self._bar.update(0)

    def close(self) -> None:
        """Take the bar away."""
        self._bar.close()

    def _print(self, line: str) -> None:
        if self._bar.disable:
            print(line, file=self._out, flush=True)


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
        *(f"  refused       {text}" for text in r.refused),
        f"  way           {r.path_length_m:.1f} m in {r.sim_time_s:.0f} s of the robot's time",
        f"  took          {r.wall_time_s:.1f} s for {count(r.frames, 'picture')} and {count(r.decisions, 'cycle')},"
        f" {r.waits} of them only to ask for locale frames",
    ]
    if out is not None:
        drawn = out / "recording.rrd"
        lines.append(f"  recording     {drawn if drawn.exists() else f'none; harvey repair {out} draws it'}")
    lines += ["", *story] if story else []
    if out is not None:
        lines += ["", f"open it with    harvey view {out}", f"have it told    harvey story {out}",
                  f"ask it with     harvey why {out}"]
    return "\n".join(lines)


def format_results(results: Sequence[MissionResult]) -> str:
    """A table, one row a seed, with a summary row: counts are summed, ways averaged, of errors the worst is shown."""
    counts = [(r.milestones["verified"] or 0, r.milestones["refuted"] or 0, r.false_accepts, r.sketches, r.replans,
               r.relocalizations, r.collisions or 0) for r in results]
    ways = [(r.path_length_m, r.sim_time_s, r.decisions, r.wall_time_s) for r in results]
    reached = sum(r.outcome == "reached" for r in results)
    rows = [_row(str(r.seed), r.outcome, "", r.error_m, counted, way)
            for r, counted, way in zip(results, counts, ways, strict=True)]
    rows.append(_row("all", f"{reached} of {len(results)} reached", "max ", max(r.error_m for r in results),
                     [sum(column) for column in zip(*counts, strict=True)],
                     [math.fsum(column) / len(results) for column in zip(*ways, strict=True)]))
    return "\n".join([table(COLUMNS, rows, last_is_summary=True),
                      *(f"seed {r.seed}: {text}" for r in results for text in (*r.amiss, *r.starved, *r.refused))])


def _row(
    what: str, outcome: str, sign: str, error_m: float, counts: Sequence[int], ways: Sequence[float]
) -> tuple[str, ...]:
    """``ways``: the path [m], the robot's time [s], cycles, time that it took [s]."""
    path_m, robot_s, cycles, wall_s = ways
    return (what, outcome, f"{sign}{error_m * 1000:.1f}", f"{error_m / INCH_M:.2f}", *map(str, counts),
            f"{path_m:.1f}", f"{robot_s:.0f}", f"{cycles:.0f}", f"{wall_s:.1f}")
