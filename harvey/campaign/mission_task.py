"""One mission by scenario, settings and seed, as a task that any process can run with the same result; and several.

Missions of several seeds are a campaign: what is kept of each, and what is driven again after a kill.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Sequence
from contextlib import ExitStack, closing
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, Literal, TextIO

from tqdm import tqdm

from blackboard import Sink
from harvey.agent_settings import Pairs, split_settings
from harvey.campaign.engine import Campaign, run_campaign
from harvey.campaign.summary import ProgressLine
from harvey.campaign.workers import Killed
from harvey.errors import BadInput
from harvey.runner.result import MissionResult, format_error
from harvey.runner.resume import find_remains
from harvey.simulation.simulated_run import build_head, resume_mission, run_mission
from logs.decided_by import DIGITS
from logs.run_directory import RunDirectory, make_room
from logs.run_head import RunHead
from sim.scenario import FORMAT, Scenario, ScenarioError, load_scenario, with_settings
from sim.stage import Stage, build_stage
from world_models.files.toml.source import WorldError
from world_models.files.world_files import fingerprint


@dataclass(frozen=True, slots=True)
class Task:
    """One mission to run.

    Attributes:
        scenario: name or file.
        settings: (key, value) as in ``--set key=value``.
        seed: of all chance.
        out: its run directory; None keeps nothing.
        body: how the simulated body is reached.
        go_on: keep what is in ``out`` of this mission already, and go on where it was cut off.
        sync: force what is written onto the disk before it is acted on.
        recording: draw one into ``out``.
    """

    scenario: str
    settings: tuple[tuple[str, str], ...]
    seed: int
    out: Path | None = None
    body: str = "simulated"
    go_on: bool = False
    sync: bool = False
    recording: bool = True

    @property
    def agent_settings(self) -> Pairs:
        """Those of the settings that are numbers of the knowledge sources. Raises BadInput."""
        return self._split()[1]

    def _split(self) -> tuple[dict[str, Any], Pairs]:
        """The settings of the scenario, and those of the agent. Raises BadInput for what neither knows."""
        return split_settings(dict(self.settings), FORMAT.keys())

    @property
    def name(self) -> str:
        """The mission in a line, whatever its seed."""
        return " ".join([self.scenario, *(f"{key}={value}" for key, value in self.settings)])

    @property
    def label(self) -> str:
        """In a line."""
        return " ".join([self.scenario, f"seed {self.seed}", *(f"{key}={value}" for key, value in self.settings)])

    def load(self) -> Scenario:
        """The scenario with its settings. Raises BadInput where it or a setting cannot be used."""
        try:
            return with_settings(load_scenario(self.scenario), self._split()[0])
        except ScenarioError as error:
            raise BadInput(str(error)) from None

    def stage(self) -> Stage:
        """The scenario with its building, set once for all the seeds that a process drives.

        Raises BadInput as :meth:`load`, and where the two do not fit.
        """
        scenario = self.load()
        try:
            files = tuple(fingerprint(path) for path in (scenario.world, *scenario.details))
        except (OSError, WorldError):
            files = ()  # the error is reported where they are read
        texts = scenario.source.text, scenario.folder, tuple(self._split()[0].items()), files
        try:
            return _stage(_Staged(texts, scenario))
        except ScenarioError as error:
            raise BadInput(str(error)) from None

    def head(self, stage: Stage) -> RunHead:
        """How its run begins."""
        return build_head(stage, self.seed, self.body, self.agent_settings)


@dataclass(frozen=True, slots=True)
class _Staged:
    """A scenario; the same as another where all the texts are that it and its building were read from."""

    texts: tuple[object, ...]
    scenario: Scenario = field(compare=False)


@lru_cache(maxsize=1)
def _stage(staged: _Staged) -> Stage:
    return build_stage(staged.scenario)


def run_task(
    task: Task, *, sinks: Sequence[Sink] = (), progress: TextIO | None = None, live: bool = False
) -> MissionResult:
    """Run one mission, and show meanwhile how far it is. Raises BadInput for what the user gave."""
    stage = task.stage()
    with ExitStack() as shown:
        if progress is not None:
            sinks = (shown.enter_context(closing(ProgressLine(stage, progress))), *sinks)
        if task.go_on and task.out is not None and (task.out / "run.json").exists():
            if (found := find_finished(task, stage)) is not None:
                return found
            run = RunDirectory(task.out)
            return resume_mission(run, find_remains(run), sinks=sinks, live=live, stage=stage, sync=task.sync,
                                  recording=task.recording)
        out = None if task.out is None else make_room(task.out, stage.scenario.name, task.seed)
        return run_mission(stage, task.seed, out=out, sinks=sinks, live=live, head=task.head(stage), sync=task.sync,
                           recording=task.recording)


def find_finished(task: Task, stage: Stage) -> MissionResult | None:
    """The result of the task's run, if it has ended. Raises BadInput where another mission is there."""
    if task.out is None or not (task.out / "run.json").exists():
        return None
    run = RunDirectory(task.out)
    if not RunHead.read(run.path).is_like(task.head(stage)):
        raise BadInput(f"{run.path}: expected a run of {task.label}, got one that began differently")
    remains, record = find_remains(run), run.read_result()
    if remains.outcome is None or record.get("outcome") != remains.outcome.kind:
        return None
    try:
        return MissionResult.of_record(record)
    except TypeError as error:
        raise BadInput(f"{run.result}: {error}") from None


Keep = Literal["all", "failures", "none"]
"""Whose run directories stay: of all missions, of those that do not reach their goal, or none is written."""


def drive_missions(
    tasks: Sequence[Task], folder: Path, out: TextIO, keep: Keep = "all"
) -> dict[Task, MissionResult | Killed]:
    """Drive one scenario with several seeds; results are kept in ``folder`` as they come.

    Meanwhile ``out`` shows how many are done: by a bar on a terminal, else by a line for each.

    Where the tasks are to go on, missions with a result are not driven again. One that was cut off is driven again, not
    resumed: so its journal and result are those of a mission that nobody disturbed.

    Raises:
        BadInput: as :func:`~harvey.campaign.engine.run_campaign`, and for what the user gave.
    """
    first = tasks[0]
    mission = replace(replace(first, seed=0).head(first.stage()), code="", arithmetic="", libraries={})
    by_seed = {task.seed: task for task in tasks}
    campaign = Campaign(
        partial(drive_kept, keep=keep), by_seed, folder, MissionResult.record, MissionResult.of_record,
        about={"mission": hashlib.sha256(json.dumps(asdict(mission)).encode()).hexdigest()[:DIGITS]},
        name=first.name, unit="mission", anew=not first.go_on,
        has_files=lambda seed: keep != "all" or _is_finished(by_seed[seed].out),
    )
    done: dict[Task, MissionResult | Killed] = {}
    with tqdm(total=len(tasks), file=out, disable=not out.isatty(), unit="mission", leave=False) as bar:
        for seed, result in run_campaign(campaign):
            done[by_seed[seed]] = result
            bar.update()
            if bar.disable:
                how = result.text if isinstance(result, Killed) else f"{result.outcome}, {format_error(result.error_m)}"
                print(f"{len(done)} of {len(tasks)}: {by_seed[seed].label}: {how}", file=out, flush=True)
    return done


def drive_kept(task: Task, keep: Keep) -> MissionResult:
    """Drive a mission, or take the result of its finished run, and keep its run directory or not."""
    found = find_finished(task, task.stage()) if task.go_on else None
    if found is not None and task.out is not None and not RunHead.read(task.out).decided_elsewhere():
        return found
    result = run_task(replace(task, go_on=False, out=None if keep == "none" else task.out))
    if keep == "failures" and result.outcome == "reached" and task.out is not None:
        shutil.rmtree(task.out)
    return result


def _is_finished(out: Path | None) -> bool:
    return out is None or ((out / "result.json").exists() and (out / "journal.jsonl").exists())
