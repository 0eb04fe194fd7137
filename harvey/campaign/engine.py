"""Engine: work on each case of a campaign, over local processes or a cluster, with results kept as they come.

A result depends on its case alone. So neither the number and kind of the workers, nor a kill of any of them or of the
engine itself, changes what a campaign finds: the results file is the same byte for byte at the end.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any, Generic, TypeVar

from harvey.campaign.case_work import Answer, Killed, check_origin
from harvey.campaign.local_workers import map_locally
from harvey.campaign.origin import origin
from harvey.campaign.results_file import open_results, read_times
from harvey.campaign.workers import Workers, chosen_workers, find_cluster
from harvey.errors import BadInput

T = TypeVar("T")
R = TypeVar("R")

CAMPAIGN = "campaign.json"
MEASURED = ("wall_time_s", "wall_s", "seconds")
"""Fields of results that tell of the machine, not of the case: they are kept beside the results."""


@dataclass(frozen=True, slots=True)
class Campaign(Generic[T, R]):
    """Cases to work on.

    Attributes:
        work: a function of a module, so that another process finds it.
        cases: by number, which is their key in the results file.
        folder: where results are kept.
        to_record, of_record: a result as JSON types, and back.
        about: what else the results follow from; kept results of anything else are computed again.
        name: of the campaign, for people; unit: what a case is.
        has_files: whether what a kept result of a case needs beside it is there; without, the case is done again.
    """

    work: Callable[[T], R]
    cases: Mapping[int, T]
    folder: Path
    to_record: Callable[[R], Mapping[str, Any]]
    of_record: Callable[[Mapping[str, Any]], R]
    about: Mapping[str, Any] = field(default_factory=dict)
    name: str = "campaign"
    unit: str = "case"
    has_files: Callable[[int], bool] = lambda case: True


def map_cases(
    work: Callable[[T], R], cases: Sequence[T], workers: Workers | None = None,
    tell: Callable[[str], None] | None = None,
) -> Iterator[tuple[int, Answer | Killed]]:
    """(place in ``cases``, answer) as they are done, in whatever order; kept nowhere. Raises BadInput.

    Args:
        workers: who works; None for those that the command was told to use.
        tell: is told where a cluster's dashboard is.
    """
    workers = workers or chosen_workers()
    if workers.cluster is not None:
        done = find_cluster("--cluster").map_on_cluster(work, cases, workers.cluster, tell)
    else:
        done = map_locally(work, cases, workers.number)
    for place, answer in done:
        if isinstance(answer, Answer):
            check_origin(answer)
        yield place, answer


def map_values(work: Callable[[T], R], cases: Sequence[T]) -> Iterator[tuple[int, R]]:
    """(place in ``cases``, what ``work`` returns), as :func:`map_cases`. Raises BadInput where a case is given up."""
    for place, answer in map_cases(work, cases):
        if isinstance(answer, Killed):
            raise BadInput(f"case {place}: {answer.text}")
        yield place, answer.value


def run_campaign(campaign: Campaign[T, R], workers: Workers | None = None) -> Iterator[tuple[int, R | Killed]]:
    """(case, result), first those that are kept already, then as they are done; on the disk before they are told.

    Raises:
        BadInput: another process works on it, or the workers cannot be used. What ``work`` raises comes through.
    """
    workers = workers or chosen_workers()
    with open_results(campaign.folder, {**origin(), **campaign.about}) as results:
        tell = partial(_describe, campaign, workers)
        tell(None)
        measured = {record["case"]: record for record in read_times(campaign.folder)}
        kept = [case for case in campaign.cases if case in results.known and campaign.has_files(case)]
        for case in kept:
            yield case, campaign.of_record(_with_measured(results.known[case], measured.get(case, {})))
        todo = [case for case in campaign.cases if case not in set(kept)]
        for place, answer in map_cases(campaign.work, [campaign.cases[case] for case in todo], workers, tell):
            case = todo[place]
            if isinstance(answer, Killed):
                results.give_up(case, answer.kills)
                yield case, answer
                continue
            record, times = _split_measured(campaign.to_record(answer.value))
            results.add(case, record, {"at": round(time.time(), 3), "took_s": round(answer.seconds, 4),
                                       "worker": answer.worker, "measured": times})
            yield case, answer.value
        results.sort()


def _describe(campaign: Campaign[Any, Any], workers: Workers, dashboard: str | None) -> None:
    """Write what ``harvey campaign show`` needs beside the results."""
    about = {"name": campaign.name, "unit": campaign.unit, "total": len(campaign.cases), "workers": workers.text,
             "dashboard": dashboard, "began": datetime.now(UTC).isoformat(timespec="seconds")}
    (campaign.folder / CAMPAIGN).write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")


def _split_measured(record: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """What follows from the case, with None where something was measured; and what was."""
    times = {key: record[key] for key in MEASURED if key in record}
    return {**record, **dict.fromkeys(times)}, times


def _with_measured(record: Mapping[str, Any], times: Mapping[str, Any]) -> dict[str, Any]:
    """Both together; NaN where a kill lost what was measured."""
    measured = times.get("measured", {})
    return {**record, **{key: measured.get(key, float("nan")) for key in MEASURED if key in record}}
