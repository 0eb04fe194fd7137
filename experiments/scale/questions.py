"""Questions after runs, answered by ``harvey why`` and by deciding again with the thing changed.

Missions with and without trouble are driven and kept. Each is asked what it did next, why, why not, what if, since
when, and what something rested on. An answer is right if deciding that cycle again, with one thing changed, says so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.generated.missions import HALLWAY, OFFICE, fault
from experiments.report import Report
from experiments.scale.questions_asked import KINDS, Question, ask
from experiments.trials import at_least, campaign_folder, run_trials
from harvey.campaign.mission_task import Task, run_task
from logs.run_directory import RunDirectory

MISSIONS: Mapping[str, str] = {
    "office": OFFICE,
    "hallway": HALLWAY,
    "bump": HALLWAY + fault("bump", "hallway", 7.0, left_m=0.3, turn_deg=10.0),
    "kidnap": OFFICE + fault("kidnap", "allens-office", 3.0, distance_m=0.8, turn_deg=30.0),
}
QUESTIONS, EACH = 1000, 100
"""So many are asked at least, of each run about so many."""
QUICK_QUESTIONS = 70
WANTED = 0.999
PEOPLE, BEST_MODEL = "98", "61"
"""% of such questions about a recorded episode that people, and the best language model, answer rightly."""
SHOWN = 5


@dataclass(frozen=True, slots=True)
class Asking:
    """Questions about one mission: how many of each kind, and those whose two answers differ."""

    mission: str
    seed: int
    asked: dict[str, int]
    wrong: list[dict[str, Any]]


@dataclass(frozen=True, slots=True)
class Interview:
    """A mission to be driven and asked about."""

    mission: str
    task: Task
    questions: int


def run(quick: bool, seed: int) -> Report:
    """Drive and ask; quick: one mission across an office."""
    folder = campaign_folder("questions", seed, quick=quick)
    missions: Mapping[str, str] = {"office": OFFICE} if quick else MISSIONS
    for name, text in missions.items():
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    each = QUICK_QUESTIONS if quick else EACH
    number = 1 if quick else -(-QUESTIONS // EACH) + len(MISSIONS)
    names = list(missions)
    interviews = [_interview(names[n % len(names)], seed + n // len(names), each, folder) for n in range(number)]
    return _report(run_trials(question, interviews, Asking, folder, "mission"), seed)


def _interview(name: str, seed: int, questions: int, folder: Path) -> Interview:
    return Interview(name, Task(str(folder / f"{name}.toml"), (), seed, folder / f"{name}-{seed}"), questions)


def question(interview: Interview) -> Asking:
    """Drive one mission and ask about it."""
    task = interview.task
    if task.out is None:
        raise ValueError("expected a task that keeps its run, got one that keeps nothing")
    run_task(task)
    rng = np.random.default_rng([task.seed, *interview.mission.encode()])
    found = list(ask(RunDirectory(task.out), interview.questions, rng))
    return Asking(interview.mission, task.seed, {kind: sum(one.kind == kind for one in found) for kind in KINDS},
                  [_record(one) for one in found if not one.agrees])


def _record(one: Question) -> dict[str, Any]:
    return {"kind": one.kind, "cycle": one.cycle, "text": one.text, "told": one.told, "decided": one.decided}


def _report(found: Sequence[Asking], seed: int) -> Report:
    asked = {kind: sum(one.asked[kind] for one in found) for kind in KINDS}
    wrong = {kind: sum(other["kind"] == kind for one in found for other in one.wrong) for kind in KINDS}
    total, right = sum(asked.values()), sum(asked.values()) - sum(wrong.values())
    rows = [(kind, None, None, None, 100.0 * (asked[kind] - wrong[kind]) / asked[kind] if asked[kind] else None,
             asked[kind]) for kind in KINDS]
    examples = [f"otherwise: {one.mission}, seed {one.seed}, cycle {other['cycle']}: {other['text']} told:"
                f" {other['told']}; decided again: {other['decided']}" for one in found for other in one.wrong]
    seeds = sorted({one.seed for one in found})
    return Report(
        "Questions after runs: answers of harvey why that are those of deciding again, %",
        ("question", "paper", "peer: people", "peer: best language model", "ours", "asked"),
        (*rows, ("all", None, PEOPLE, BEST_MODEL, 100.0 * right / total if total else None, total)),
        (
            f"{len(found)} missions ({', '.join(dict.fromkeys(one.mission for one in found))}), seeds {seeds[0]} to"
            f" {seeds[-1]}, questions drawn with seed {seed} and up.",
            "What is changed in the one cycle that is decided again: why, the entry that woke it is withdrawn; why not,"
            " all others are silent; what if, a knowledge source is silent; since when, nobody acts; rested on, an"
            " entry is withdrawn beneath the act. Beyond that cycle nothing is asked.",
            "Of the paper there is no figure. People and the best language model: questions of such kinds about a"
            " recorded episode, by their authors' figures, not measured here; theirs are in free words, ours are"
            " generated.",
            f"At least {100.0 * at_least(right, total):.2f} % with 95 % confidence.",
            *examples[:SHOWN],
        ),
        ((f"at least {100.0 * WANTED:.1f} % of {total} answers are those of deciding again ({right})",
          total > 0 and right >= WANTED * total),),
    )
