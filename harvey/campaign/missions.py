"""Missions of several seeds as a campaign: what is kept of each, and what is driven again after a kill."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

from harvey.campaign.campaign import Task, find_finished, run_task
from harvey.campaign.case_work import Killed
from harvey.campaign.engine import CAMPAIGN, Campaign, run_campaign
from harvey.campaign.results_file import RESULTS, TIMES, open_results
from logs.decided_by import DIGITS

if TYPE_CHECKING:
    from harvey.runner.result import MissionResult

Keep = Literal["all", "failures", "none"]
"""Whose run directories stay: of all missions, of those that do not reach their goal, or none is written."""
KEEP: tuple[Keep, ...] = get_args(Keep)


def drive_missions(
    tasks: Sequence[Task], folder: Path, keep: Keep = "all"
) -> Iterator[tuple[Task, MissionResult | Killed]]:
    """Drive one scenario with several seeds; results are kept in ``folder`` and come as they are known.

    Where the tasks are to go on, missions with a result are not driven again. One that was cut off is driven anew, not
    resumed: so its journal and result are those of a mission that nobody disturbed.

    Raises:
        BadInput: as :func:`~harvey.campaign.engine.run_campaign`, and for what the user gave.
    """
    from harvey.runner.result import MissionResult

    stage = tasks[0].stage()
    from harvey.simulation.run import build_head

    head = replace(build_head(stage, 0, tasks[0].body, tasks[0].agent_settings), code="", arithmetic="")
    by_seed = {task.seed: task for task in tasks}
    if not tasks[0].go_on:
        _remove_results(folder)
    campaign = Campaign(
        partial(drive_kept, keep=keep), by_seed, folder, MissionResult.record, MissionResult.of_record,
        about={"mission": hashlib.sha256(json.dumps(asdict(head)).encode()).hexdigest()[:DIGITS]},
        name=" ".join([tasks[0].scenario, *(f"{key}={value}" for key, value in tasks[0].settings)]), unit="mission",
        has_files=lambda seed: keep != "all" or _is_finished(by_seed[seed].out),
    )
    for seed, result in run_campaign(campaign):
        yield by_seed[seed], result


def drive_kept(task: Task, keep: Keep) -> MissionResult:
    """Drive a mission, or take the result of its finished run, and keep its run directory or not."""
    if task.go_on and (found := find_finished(task, task.stage())) is not None and task.out is not None:
        from logs.run_head import RunHead

        if not RunHead.read(task.out).decided_elsewhere():
            return found
    result = run_task(replace(task, go_on=False, out=None if keep == "none" else task.out))
    if keep == "failures" and result.outcome == "reached" and task.out is not None:
        shutil.rmtree(task.out)
    return result


def _is_finished(out: Path | None) -> bool:
    return out is None or ((out / "result.json").exists() and (out / "journal.jsonl").exists())


def _remove_results(folder: Path) -> None:
    """Those of an older campaign, but not while another process works on it. Raises BadInput."""
    if (folder / RESULTS).exists():
        with open_results(folder, {}):
            for name in (RESULTS, TIMES, CAMPAIGN):
                (folder / name).unlink(missing_ok=True)
