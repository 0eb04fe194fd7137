"""Progress of a mission on standard error: a bar on a terminal, lines elsewhere."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TextIO

from tqdm import tqdm

from blackboard import Decision, Sink
from harvey.campaign.campaign import Follow, Task
from harvey.campaign.case_work import Killed
from harvey.campaign.summary import format_error
from logs.explain.turning_points import TurningPoint, TurningPointFinder
from world_models.entries import Goal, Hypothesis, Milestone
from world_models.words import count

if TYPE_CHECKING:
    from harvey.runner.result import MissionResult
    from sim.stage import Stage


class Tally:
    """Counts milestones, and knows how far it is to go by Harvey's own belief.

    Attributes:
        verified: milestones so far.
        way_m, to_go_m: distance to the goal as the crow flies, at first and now.
        turns: the turning points of the last decision that must not be left out.
        is_lost: whether the robot does not know where it is.
    """

    def __init__(self, stage: Stage) -> None:
        self._world, self._goal = stage.world, stage.goal_world
        self.verified = 0
        self.turns: tuple[TurningPoint, ...] = ()
        self.is_lost = False
        self._finder = TurningPointFinder()
        self.to_go_m = self.way_m = stage.start_world.distance_to(stage.goal_world)

    def __call__(self, decision: Decision) -> None:
        self.turns = tuple(point for point in self._finder.find(decision) if point.is_main)
        for point in self.turns:
            if point.kind in ("lost", "found"):
                self.is_lost = point.kind == "lost"
        for change in decision.made:
            value = change.entry.value
            if isinstance(value, Milestone):
                self.verified += value.status == "verified"
            elif isinstance(value, Goal) and value.is_active:
                self._goal = value.destination.in_world(self._world)
            elif isinstance(value, Hypothesis) and value.is_held:
                self.to_go_m = value.world_from_robot(self._world).distance_to(self._goal)


class Bar:
    """A bar that fills as the way to go shrinks."""

    def __init__(self, tally: Tally, out: TextIO) -> None:
        self._tally = tally
        self._bar = tqdm(total=tally.way_m, file=out, leave=False, dynamic_ncols=True,
                         bar_format="{percentage:3.0f} %|{bar}| {desc} [{elapsed}]")

    def __call__(self, decision: Decision) -> None:
        tally = self._tally
        self._bar.n = min(max(0.0, tally.way_m - tally.to_go_m), tally.way_m)
        line = f"{tally.to_go_m:.1f} m to go, {count(tally.verified, 'milestone')} verified, cycle {decision.cycle}"
        line += ", lost" * tally.is_lost
        self._bar.set_description_str(line, refresh=False)
        self._bar.update(0)

    def close(self) -> None:
        self._bar.close()


class Lines:
    """A line whenever a milestone is verified, and at each turning point that must not be left out."""

    def __init__(self, tally: Tally, out: TextIO) -> None:
        self._tally, self._out, self._counted = tally, out, 0

    def __call__(self, decision: Decision) -> None:
        for point in self._tally.turns:
            print(f"cycle {point.cycle}: {point.kind}: {point.text}", file=self._out, flush=True)
        if self._tally.verified > self._counted:
            self._counted = self._tally.verified
            verified = f"{count(self._counted, 'milestone')} verified"
            print(f"cycle {decision.cycle}: {verified}, {self._tally.to_go_m:.1f} m to go", file=self._out, flush=True)

    def close(self) -> None:
        """Nothing is left open."""


@contextmanager
def following(out: TextIO) -> Iterator[Follow]:
    """Shows the progress of one mission, and tidies up however it ends."""
    shown: list[Bar | Lines] = []

    def follow(tally: Tally) -> Sink:
        shown.append(Bar(tally, out) if out.isatty() else Lines(tally, out))
        return shown[-1]

    try:
        yield follow
    finally:
        for item in shown:
            item.close()


def count_missions(
    done: Iterable[tuple[Task, MissionResult | Killed]], total: int, out: TextIO
) -> Iterator[tuple[Task, MissionResult | Killed]]:
    """Missions as they are done, with a bar on a terminal and a line for each elsewhere."""
    with tqdm(total=total, file=out, disable=not out.isatty(), unit="mission", leave=False) as bar:
        for number, (task, result) in enumerate(done, 1):
            if not out.isatty():
                how = (result.text if isinstance(result, Killed)
                       else f"{result.outcome}, {format_error(result.error_m)}")
                print(f"{number} of {total}: {task.label}: {how}", file=out, flush=True)
            bar.update()
            yield task, result
