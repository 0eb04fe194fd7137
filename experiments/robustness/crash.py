"""Crash safety: missions are killed (SIGKILL) at random moments and resumed.

Claimed: every motor command that reached the body is in the journal, and none reached it twice; every resumed run
reaches its goal; its whole journal, the crash included, is replayed byte for byte.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from experiments.generated.missions import HALLWAY, OFFICE, fault
from experiments.report import Cell, Report
from experiments.trials import campaign_folder, run_trials
from harvey.simulation.body_replay import find_interrupted
from logs.timeline import Timeline

CHILD = (sys.executable, "-m", "experiments.robustness.crash_child")
MAX_CHILD_S = 600.0
"""Time limit of a child process [s]."""
MAX_DELAY_S = 0.06
"""Longest time from a decision to a kill: about the time of a cycle."""
MAX_RESUME_S = 12.0
"""Longest time from the start of a process that resumes to its kill."""
TEXTS: Mapping[str, str] = {
    "office": OFFICE,
    "hallway": HALLWAY,
    "hallway, bumped": HALLWAY + fault("bump", "hallway", 7.0, left_m=0.3, turn_deg=10.0),
    "hallway, dark": HALLWAY + fault("lights_off", "hallway", 5.0, duration_s=8.0),
    "hallway, link lost": HALLWAY + fault("link_lost", "hallway", 6.0, duration_s=4.0),
}
MAIN = "lab-to-allens-office"
FULL: Mapping[str, int] = {"office": 100, "hallway": 30, "hallway, bumped": 30, "hallway, dark": 15,
                           "hallway, link lost": 15, MAIN: 10}
QUICK: Mapping[str, int] = {"office": 3}
DECISIONS: Mapping[str, int] = {"office": 45, "hallway": 120, "hallway, bumped": 130, "hallway, dark": 120,
                                "hallway, link lost": 120, MAIN: 440}
"""Approximate number of decisions of a mission; a kill falls after one of them."""


@dataclass(frozen=True, slots=True)
class Trial:
    """A mission and when to kill it.

    Attributes:
        number: of the trial; with the experiment's seed it determines all random numbers.
        seed: of the mission.
        after: decisions before the first kill.
        delay_s: time between the last of them and the kill.
        again_s: time from the start of the process that resumes to a second kill; None for none.
    """

    number: int
    scenario: str
    seed: int
    after: int
    delay_s: float
    again_s: float | None


@dataclass(frozen=True, slots=True)
class CrashResult:
    """Result of a trial.

    Attributes:
        kills: processes that were killed before they ended.
        in_motion: motor commands that were interrupted.
        wrong: what was lost or done twice; "" for nothing.
        outcome, error_m: of the mission.
        seconds: wall-clock time.
    """

    number: int
    scenario: str
    kills: int
    in_motion: int
    wrong: str
    outcome: str
    error_m: float
    seconds: float


def run(quick: bool, seed: int) -> Report:
    """Kill and resume; results are kept, so that the experiment itself may be interrupted."""
    trials = list(_draw_trials(QUICK if quick else FULL, seed))
    folder = campaign_folder("crash", seed, quick=quick)
    results = run_trials(partial(run_trial, folder=folder), trials, CrashResult, folder)
    names = list(dict.fromkeys(trial.scenario for trial in trials))
    rows = [_row(name, [r for r in results if r.scenario == name]) for name in names]
    killed = sum(r.kills for r in results)
    failed = [f"trial {r.number} ({r.scenario}): {r.wrong or r.outcome}; kept in {folder / str(r.number)}"
              for r in results if r.wrong or r.outcome != "reached"]
    return Report(
        "Missions killed at random moments and resumed",
        ("scenario", "missions", "kills", "in motion", "nothing lost", "reached", "worst mm", "seconds"), tuple(rows),
        notes=(
            f"Trials 0 to {len(trials) - 1} of seed {seed}: SIGKILL after a random decision and up to {MAX_DELAY_S} s; "
            f"in one of four a second kill, up to {MAX_RESUME_S:.0f} s after the start of the process that resumes.",
            "in motion: motor commands in the journal without a report; they are not executed again.",
            "nothing lost: every command that reached the body is in the journal once, and the whole journal is "
            "replayed byte for byte.",
            *failed,
        ),
        claims=(
            (f"{killed} kills: nothing acknowledged is lost, nothing done twice", not any(r.wrong for r in results)),
            ("every resumed run reaches its goal", all(r.outcome == "reached" for r in results)),
        ),
    )


def _draw_trials(shares: Mapping[str, int], seed: int) -> Iterator[Trial]:
    """Draw scenarios in random order, so that an interrupted experiment has done a fair part of each."""
    names = [name for name, share in shares.items() for _ in range(share)]
    order = np.random.default_rng(seed).permutation(len(names))
    for number, name in enumerate(names[i] for i in order):
        rng = np.random.default_rng([seed, number])
        after = int(rng.integers(0, DECISIONS[name]))
        delay_s = float(rng.uniform(0.0, MAX_DELAY_S))
        again_s = float(rng.uniform(2.0, MAX_RESUME_S)) if rng.random() < 0.25 else None
        yield Trial(number, name, number, after, delay_s, again_s)


def _row(name: str, results: Sequence[CrashResult]) -> tuple[Cell, ...]:
    return (
        name, len(results), sum(r.kills for r in results), sum(r.in_motion for r in results),
        sum(1 for r in results if not r.wrong), sum(1 for r in results if r.outcome == "reached"),
        1000.0 * max(r.error_m for r in results), float(np.sum([r.seconds for r in results])),
    )


def run_trial(trial: Trial, folder: Path) -> CrashResult:
    """Run one trial; its files are kept if something is wrong."""
    began, place = time.perf_counter(), folder / str(trial.number)
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir()
    out, logs = place / "run", [place / "commands-0.jsonl"]
    kills = _run_and_kill(trial, place, logs[0])
    if trial.again_s is not None:
        logs.append(place / f"commands-{len(logs)}.jsonl")
        kills += _kill_after((*CHILD, "resume", str(out), str(logs[-1])), trial.again_s)
    logs.append(place / f"commands-{len(logs)}.jsonl")
    done = subprocess.run((*CHILD, "resume", str(out), str(logs[-1])), capture_output=True, text=True, check=False,
                          timeout=MAX_CHILD_S)
    seconds = time.perf_counter() - began
    if done.returncode:
        wrong = done.stderr[-400:] or "no result"
        return CrashResult(trial.number, trial.scenario, kills, 0, wrong, "none", 0.0, seconds)
    result = json.loads(done.stdout.splitlines()[-1])
    interrupted, wrong = _compare(out / "journal.jsonl", logs)
    wrong = wrong or ("" if result["same"] else "the journal is not replayed as it is")
    if not wrong and result["outcome"] == "reached":
        shutil.rmtree(place)
    return CrashResult(trial.number, trial.scenario, kills, interrupted, wrong, result["outcome"], result["error_m"],
                       seconds)


def _run_and_kill(trial: Trial, place: Path, log: Path) -> int:
    scenario = trial.scenario
    if scenario in TEXTS:
        scenario = str(place / "scenario.toml")
        Path(scenario).write_text(TEXTS[trial.scenario], encoding="utf-8")
    journal = place / "run" / "journal.jsonl"
    with subprocess.Popen((*CHILD, "run", scenario, str(trial.seed), str(place / "run"), str(log)),
                          stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as child:
        while child.poll() is None and _lines(journal) < max(trial.after, 0):
            time.sleep(0.002)
        while child.poll() is None and not journal.exists():
            time.sleep(0.002)
        time.sleep(trial.delay_s)
        running = child.poll() is None
        child.kill()
    return int(running)


def _kill_after(command: Sequence[str], seconds: float) -> int:
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as child:
        try:
            child.wait(seconds)
        except subprocess.TimeoutExpired:
            child.kill()
            return 1
    return 0


def _lines(path: Path) -> int:
    return path.read_bytes().count(b"\n") if path.exists() else 0


def _compare(journal: Path, logs: Sequence[Path]) -> tuple[int, str]:
    """Count interrupted commands, and describe how journal and body disagree ("" if they do not)."""
    commands: list[tuple[str, list[float]]] = []
    interrupted: set[str] = set()
    for decision in Timeline(journal).decisions():
        interrupted |= find_interrupted(decision.observed)
        commands += [(record.ref, [record.fields["turn_rad"], record.fields["move_m"]])
                     for record in decision.made if record.type == "MotorCommand"]
    lines = (line for log in logs if log.exists() for line in log.read_text("utf-8").splitlines())
    done = [item["begun"] for item in map(json.loads, lines) if "begun" in item]
    return len(interrupted), _disagreement(commands, frozenset(interrupted), done)


def _disagreement(
    commands: Sequence[tuple[str, list[float]]], excused: frozenset[str], done: Sequence[list[float]]
) -> str:
    """Check that each executed command is in the journal once, in order, and any other was interrupted before."""
    written = iter(commands)
    for command in done:
        for ref, what in written:
            if what == command:
                break
            if ref not in excused:
                return f"{ref} is in the journal, but never reached the body"
        else:
            return f"the command {command} reached the body, but is not in the journal, or was done twice"
    left = [ref for ref, _ in written if ref not in excused]
    return f"{left[0]} is in the journal, but never reached the body" if left else ""
