"""Run many trials on all cores and keep each result, so that an interrupted campaign continues; bounds of rates."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any, TypeVar

from scipy.stats import beta
from tqdm import tqdm

from experiments.report import Finding
from harvey.campaign.engine import RESULTS, Campaign, run_campaign
from harvey.campaign.workers import Killed
from harvey.errors import BadInput
from logs.run_directory import RUNS

__all__ = ["RESULTS", "campaign_folder", "run_trials"]

T = TypeVar("T")
R = TypeVar("R")


def campaign_folder(name: str, seed: int, *, quick: bool) -> Path:
    """Make the folder of a campaign's results, table and pictures: ``runs/experiments/NAME/...``."""
    folder = RUNS / "experiments" / name / f"{'quick' if quick else 'full'}-{seed}"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def run_trials(work: Callable[[T], R], trials: Sequence[T], kind: type[R], folder: Path, unit: str = "trial",
               ) -> list[R]:
    """Return the result of each trial, in order; results that ``folder`` has already are not computed again.

    Args:
        work: a function of a module, called in the workers that the command was told to use.
        kind: the dataclass of a result, of plain JSON types, or one with ``record`` and ``of_record``.

    Raises:
        BadInput: the workers of a trial were killed again and again; the other trials are done then, and kept.
    """
    if not is_dataclass(kind):
        raise ValueError(f"expected a dataclass of results, got {kind}")
    to_record: Callable[[Any], Mapping[str, Any]] = getattr(kind, "record", asdict)
    of_record: Callable[[Mapping[str, Any]], R] = getattr(kind, "of_record", lambda record: kind(**record))
    campaign = Campaign(work, dict(enumerate(trials)), folder, to_record, of_record, name=folder.parent.name, unit=unit)
    done: dict[int, R] = {}
    killed: dict[int, Killed] = {}
    with tqdm(total=len(trials), unit=unit, file=sys.stderr, disable=not sys.stderr.isatty(), leave=False) as bar:
        for number, result in run_campaign(campaign):
            if isinstance(result, Killed):
                killed[number] = result
            else:
                done[number] = result
            bar.update()
    if killed:
        number, first = min(killed.items())
        raise BadInput(f"{len(killed)} of {len(trials)} trials are missing, the rest is kept in {folder / RESULTS};"
                       f" trial {number} was {first.text}")
    return [done[number] for number in range(len(trials))]


CONFIDENCE = 0.95


def at_most(found: int, of: int) -> float:
    """The upper bound of a rate: 0 of 1,000 proves 0.3 %; nothing is proved by none."""
    _check(found, of)
    return 1.0 if found == of else float(beta.ppf(CONFIDENCE, found + 1, of - found))


def at_least(found: int, of: int) -> float:
    """The lower bound of a rate."""
    return 1.0 - at_most(of - found, of)


def judge_share(right: int, of: int, least: float) -> Finding:
    """What such a sample says of the claim that the rate is ``least`` or more: one below it fails."""
    if of and at_least(right, of) >= least:
        return "proved"
    return "not contradicted" if right >= least * of else "fails"


def judge_rare(wrong: int, of: int, most: float) -> Finding:
    """The same of the claim that the rate is ``most`` or less; that something never happens no sample proves."""
    return judge_share(of - wrong, of, 1.0 - most)


def is_surely_within(found: int, of: int, low: float, high: float) -> bool:
    """Whether a rate lies from ``low`` to ``high`` with both of its bounds: what chance alone explains does not do."""
    return low <= at_least(found, of) and at_most(found, of) <= high


def _check(found: int, of: int) -> None:
    if not 0 <= found <= of:
        raise ValueError(f"expected 0 to {of} of {of}, got {found}")
