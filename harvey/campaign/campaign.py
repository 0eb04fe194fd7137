"""One mission by scenario, settings and seed, as a task that any process can run with the same result; and several.

Missions of several seeds are a campaign: what is kept of each, and what is driven again after a kill.
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from blackboard import Sink
from harvey.errors import BadInput
from logs.decided_by import DIGITS
from logs.run_directory import RunDirectory, prepare_directory

if TYPE_CHECKING:
    from harvey.agent_settings import Pairs
    from harvey.campaign.case_work import Killed
    from harvey.campaign.progress import Tally
    from harvey.runner.result import MissionResult
    from sim.scenario import Scenario
    from sim.stage import Stage

Follow = Callable[["Tally"], Sink]
"""Makes the sink that shows what a tally counts; it is called after the tally."""

MAX_SEEDS = 10_000


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
    """

    scenario: str
    settings: tuple[tuple[str, str], ...]
    seed: int
    out: Path | None = None
    body: str = "simulated"
    go_on: bool = False
    sync: bool = False

    @property
    def agent_settings(self) -> Pairs:
        """Those of the settings that are numbers of the knowledge sources. Raises BadInput."""
        return self._split()[1]

    def _split(self) -> tuple[dict[str, Any], Pairs]:
        """The settings of the scenario, and those of the agent. Raises BadInput for what neither knows."""
        from harvey.agent_settings import split_settings
        from sim.scenario import FORMAT

        return split_settings(dict(self.settings), FORMAT.keys())

    @property
    def label(self) -> str:
        """In a line."""
        return " ".join([self.scenario, f"seed {self.seed}", *(f"{key}={value}" for key, value in self.settings)])

    def load(self) -> Scenario:
        """The scenario with its settings. Raises BadInput where it or a setting cannot be used."""
        from sim.scenario import ScenarioError, load_scenario, with_settings

        try:
            return with_settings(load_scenario(self.scenario), self._split()[0])
        except ScenarioError as error:
            raise BadInput(str(error)) from None

    def stage(self) -> Stage:
        """The scenario with its building. Raises BadInput as :meth:`load`, and where the two do not fit."""
        from sim.scenario import ScenarioError
        from world_models.files.world_files import WorldError, fingerprint

        try:
            scenario = self.load()
            try:
                files = tuple(fingerprint(path) for path in (scenario.world, *scenario.details))
            except (OSError, WorldError):
                files = ()  # the error is reported where they are read
            settings = tuple(self._split()[0].items())
            return _stage(_Staged((scenario.source.text, str(scenario.folder), settings, files), scenario))
        except ScenarioError as error:
            raise BadInput(str(error)) from None


@dataclass(frozen=True, slots=True)
class _Staged:
    """A scenario; the same as another where all the texts are that it and its building were read from."""

    texts: tuple[object, ...]
    scenario: Scenario = field(compare=False)


@lru_cache(maxsize=1)
def _stage(staged: _Staged) -> Stage:
    """Set once for all the seeds that a process drives."""
    from sim.stage import build_stage

    return build_stage(staged.scenario)


def parse_seeds(text: str) -> tuple[int, ...]:
    """``3``, ``0..19`` (both included) or ``1,4,9``. Raises BadInput."""
    seeds: list[int] = []
    for part in text.split(","):
        match = re.fullmatch(r"(\d{1,9})(?:\.\.(\d{1,9}))?", part.strip(), re.ASCII)
        first, last = (int(match[1]), int(match[2] or match[1])) if match else (1, 0)
        if last < first or last - first >= MAX_SEEDS:
            raise BadInput("--seed: expected a number from 0 to 999999999, a range as 0..19 or a list as 1,4,9,"
                           f" of {MAX_SEEDS} at most, got {text!r}")
        seeds += range(first, last + 1)
    return tuple(dict.fromkeys(seeds))


def parse_pairs(texts: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """``key=value`` pairs. Raises BadInput."""
    for text in texts:
        if not text.partition("=")[0] or "=" not in text:
            raise BadInput(f"--set: expected key=value, as servo.action=off, got {text!r}")
    pairs = (text.partition("=") for text in texts)
    return tuple((key.strip(), value.strip()) for key, _, value in pairs)


def run_task(
    task: Task, *, sinks: Sequence[Sink] = (), follow: Follow | None = None, live: bool = False
) -> MissionResult:
    """Run one mission; ``follow`` makes a sink that shows what is counted. Raises BadInput for what the user gave."""
    stage = task.stage()
    from harvey.campaign.progress import Tally
    from harvey.simulation.simulated_run import build_head, run_mission

    tally = Tally(stage)
    shown = (tally, follow(tally)) if follow else ()
    if task.go_on and task.out is not None and (task.out / "run.json").exists():
        return _keep_or_resume(RunDirectory(task.out), task, stage, (*shown, *sinks), live)
    out = None if task.out is None else make_room(task.out, stage.scenario.name, task.seed)
    head = build_head(stage, task.seed, task.body, task.agent_settings)
    return run_mission(stage, task.seed, out=out, sinks=(*shown, *sinks), live=live, head=head, sync=task.sync)


def make_room(out: Path, name: str, seed: int) -> Path:
    """An empty directory for a run; says so where a run of something else had to be moved aside. Raises BadInput."""
    path, aside = prepare_directory(out, name, seed)
    if aside is not None:
        print(f"--out {out}: the run that was there is of another scenario or seed; it is kept in {aside}",
              file=sys.stderr)
    return path


def find_finished(task: Task, stage: Stage) -> MissionResult | None:
    """The result of the task's run, if it has ended. Raises BadInput where another mission is there."""
    if task.out is None or not (task.out / "run.json").exists():
        return None
    from harvey.runner.result import MissionResult
    from harvey.runner.resume import find_remains
    from harvey.simulation.simulated_run import build_head
    from logs.run_head import RunHead

    run = RunDirectory(task.out)
    if not RunHead.read(run.path).is_like(build_head(stage, task.seed, task.body, task.agent_settings)):
        raise BadInput(f"{run.path}: expected a run of {task.label}, got one that began differently")
    remains, record = find_remains(run), run.read_result()
    if remains.outcome is None or record.get("outcome") != remains.outcome.kind:
        return None
    try:
        return MissionResult.of_record(record)
    except TypeError as error:
        raise BadInput(f"{run.result}: {error}") from None


def _keep_or_resume(run: RunDirectory, task: Task, stage: Stage, sinks: Sequence[Sink], live: bool) -> MissionResult:
    """What was done of this mission already. Raises BadInput where another mission is there."""
    from harvey.runner.resume import find_remains
    from harvey.simulation.simulated_run import resume_mission

    found = find_finished(task, stage)
    return found or resume_mission(run, find_remains(run), sinks=sinks, live=live, stage=stage, sync=task.sync)


Keep = Literal["all", "failures", "none"]
"""Whose run directories stay: of all missions, of those that do not reach their goal, or none is written."""


def drive_missions(
    tasks: Sequence[Task], folder: Path, keep: Keep = "all"
) -> Iterator[tuple[Task, MissionResult | Killed]]:
    """Drive one scenario with several seeds; results are kept in ``folder`` and come as they are known.

    Where the tasks are to go on, missions with a result are not driven again. One that was cut off is driven again, not
    resumed: so its journal and result are those of a mission that nobody disturbed.

    Raises:
        BadInput: as :func:`~harvey.campaign.engine.run_campaign`, and for what the user gave.
    """
    from harvey.campaign.engine import Campaign, run_campaign
    from harvey.runner.result import MissionResult

    stage = tasks[0].stage()
    from harvey.simulation.simulated_run import build_head

    head = replace(build_head(stage, 0, tasks[0].body, tasks[0].agent_settings), code="", arithmetic="", libraries={})
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
    from harvey.campaign.engine import CAMPAIGN, RESULTS, TIMES, open_results

    if (folder / RESULTS).exists():
        with open_results(folder, {}):
            for name in (RESULTS, TIMES, CAMPAIGN):
                (folder / name).unlink(missing_ok=True)
