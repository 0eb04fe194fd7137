"""Levels of perceptual servoing (Figure 2): missions with each level switched off.

Tested are claims of §2 and §5: with all levels every mission arrives; without the action level the robot strays
further from its path; without the plan level farther still; a kidnapped robot needs the goal level.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from experiments.report import Cell, Report, count_kinds
from experiments.trials import campaign_folder, run_trials
from harvey.campaign.mission_task import Task, run_task
from harvey.runner.result import MissionResult
from world_models.units import INCH_M

MAIN, KIDNAP = SCENARIOS = ("lab-to-allens-office", "hallway-kidnap")
LEVELS_OFF: Mapping[str, tuple[str, ...]] = {
    "all on": (), "action off": ("action",), "plan off": ("plan",), "goal off": ("goal",),
    "all off": ("action", "plan", "goal"),
}
NOT_QUICK = ((MAIN, "goal off"), (KIDNAP, "action off"), (KIDNAP, "plan off"))
"""Rows in which one mission shows no difference."""
QUICK_NOTE = (
    f"Left out by --quick, because one mission does not show the difference: {MAIN} with the goal level off (about one"
    f" mission in seven needs it), {KIDNAP} with the action or plan level off. Without --quick they are run and"
    " claimed."
)
SEEDS, QUICK_SEEDS = 20, 1
COLUMNS = ("scenario", "levels", "reached", "<= 1 inch", "otherwise", "mean mm", "max mm", "max off path mm",
           "collisions", "false accepts", "replans", "relocated")

Results = Mapping[tuple[str, str], Sequence[MissionResult]]
"""Results by scenario and setting, one per seed."""


def run(quick: bool, seed: int) -> Report:
    """Run the scenarios with every setting, over seeds ``seed``, ``seed + 1``, ..."""
    seeds = range(seed, seed + (QUICK_SEEDS if quick else SEEDS))
    tasks = {
        (scenario, name): [Task(scenario, tuple((f"servo.{level}", "off") for level in off), s) for s in seeds]
        for scenario in SCENARIOS for name, off in LEVELS_OFF.items() if not (quick and (scenario, name) in NOT_QUICK)
    }
    everything = [task for row in tasks.values() for task in row]
    folder = campaign_folder("levels", seed, quick=quick)
    done = dict(zip(everything, run_trials(run_task, everything, MissionResult, folder, "mission"), strict=True))
    results = {key: [done[task] for task in row] for key, row in tasks.items()}
    return Report(
        "Missions with levels of perceptual servoing switched off", COLUMNS,
        tuple(_row(scenario, name, missions) for (scenario, name), missions in results.items()),
        notes=(
            f"{len(seeds)} missions per row, seeds {seeds[0]} to {seeds[-1]}; errors are true distances from the goal.",
            "max off path: the largest true distance of any robot from the line of the leg that it was driving.",
            "false accepts: milestones that were verified while the robot was elsewhere.",
            "The same seed has the same noise in every row. The paper gives no figures for whole missions.",
            *([QUICK_NOTE] if quick else []),
        ),
        claims=tuple(_claims(results)),
    )


def _row(scenario: str, name: str, results: Sequence[MissionResult]) -> tuple[Cell, ...]:
    errors_m = [r.error_m for r in results]
    return (
        scenario, name, sum(1 for r in results if r.outcome == "reached"), _within_inch(results),
        count_kinds(r.outcome for r in results if r.outcome != "reached"),
        1000.0 * math.fsum(errors_m) / len(errors_m), 1000.0 * max(errors_m),
        1000.0 * max(r.max_cross_track_m or 0.0 for r in results),
        sum(r.collisions or 0 for r in results), sum(r.false_accepts for r in results),
        sum(r.replans for r in results), sum(r.relocalizations for r in results),
    )


def _claims(results: Results) -> Iterator[tuple[str, bool]]:
    for scenario in SCENARIOS:
        missions = results[scenario, "all on"]
        arrived = _within_inch(missions)
        yield f"{scenario}: with all levels on, every mission arrives within an inch", arrived == len(missions)
        yield f"{scenario}: with all levels off fewer do", _within_inch(results[scenario, "all off"]) < arrived
        if (scenario, "goal off") in results:
            yield f"{scenario}: without the goal level fewer do", _within_inch(results[scenario, "goal off"]) < arrived
    on, action_off, plan_off = (results[MAIN, name] for name in ("all on", "action off", "plan off"))
    factor, words = (1.0, "farther") if len(on) == 1 else (2.0, "more than twice as far")  # one mission shows no more
    yield (f"{MAIN}: without the action level it strays {words} from its path",
           max(r.max_cross_track_m or 0.0 for r in action_off) > factor * max(r.max_cross_track_m or 0.0 for r in on))
    yield (f"{MAIN}: without the plan level it strays more than twice as far from its path",
           max(r.max_cross_track_m or 0.0 for r in plan_off) > 2.0 * max(r.max_cross_track_m or 0.0 for r in on))


def _within_inch(results: Sequence[MissionResult]) -> int:
    """Missions that reached their goal within an inch."""
    return sum(1 for r in results if r.outcome == "reached" and r.error_m <= INCH_M)
