"""Engine: work on each case of a campaign, over local processes or a cluster, with results kept as they come.

A result depends on its case alone. So neither the number and kind of the workers, nor a kill of any of them or of the
engine itself, changes what a campaign finds: the results file is the same byte for byte at the end.

The results file is JSON lines, one a case. It is only appended to, and a line is on the disk before the next case is
taken as done. The first line says whose results these are. A kill may tear the last line; it is dropped then, and its
case done again. What was measured of the machine (seconds, worker) stands in a file of its own, so that the results are
the same byte for byte whoever worked; at the end the lines are put in the order of the cases.
"""

from __future__ import annotations

import fcntl
import json
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Generic, TypeVar

from harvey.campaign.workers import Killed, Workers, chosen_workers, map_cases, origin
from harvey.errors import BadInput
from logs.disk import MOST_JOURNAL_BYTES, no_follow, sync_folder, write_whole
from world_models.files.regular_files import read_regular

RESULTS, TIMES, CAMPAIGN = "results.jsonl", "times.jsonl", "campaign.json"
CASE, RESULT, KILLED = "case", "result", "killed"
MEASURED = ("wall_time_s", "wall_s", "seconds")
"""Fields of results that tell of the machine, not of the case: they are kept apart from the results."""

T = TypeVar("T")
R = TypeVar("R")


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
        anew: whether to do all cases again, whatever is kept.
        has_files: whether the files that a kept result of a case needs are there; if not, the case is done again.
    """

    work: Callable[[T], R]
    cases: Mapping[int, T]
    folder: Path
    to_record: Callable[[R], Mapping[str, Any]]
    of_record: Callable[[Mapping[str, Any]], R]
    about: Mapping[str, Any] = field(default_factory=dict)
    name: str = "campaign"
    unit: str = "case"
    anew: bool = False
    has_files: Callable[[int], bool] = lambda case: True


def run_campaign(campaign: Campaign[T, R], workers: Workers | None = None) -> Iterator[tuple[int, R | Killed]]:
    """(case, result), first those that are kept already, then as they are done; on the disk before they are yielded.

    Raises:
        BadInput: another process works on it, or the workers cannot be used. What ``work`` raises comes through.
    """
    workers = workers or chosen_workers()

    def describe(dashboard: str | None = None) -> None:
        about = {"name": campaign.name, "unit": campaign.unit, "total": len(campaign.cases), "workers": workers.text,
                 "dashboard": dashboard, "began": datetime.now(UTC).isoformat(timespec="seconds")}
        write_whole(campaign.folder / CAMPAIGN, json.dumps(about, indent=2) + "\n")

    with closing(Results(campaign.folder, {**origin(), **campaign.about}, anew=campaign.anew)) as results:
        describe()
        kept = {case: results.known[case] for case in campaign.cases
                if case in results.known and campaign.has_files(case)}
        for case, record in kept.items():
            yield case, campaign.of_record(record)
        todo = [case for case in campaign.cases if case not in kept]
        for place, answer in map_cases(campaign.work, [campaign.cases[case] for case in todo], workers, describe):
            case = todo[place]
            if isinstance(answer, Killed):
                results.give_up(case, answer.kills)
                yield case, answer
            else:
                results.add(case, campaign.to_record(answer.value),
                            {"took_s": round(answer.seconds, 4), "worker": answer.worker})
                yield case, answer.value
        results.sort()


class Results:
    """The results of a campaign, open for more; nobody else adds to them meanwhile.

    Attributes:
        known: result by case, with what was measured; NaN where a kill lost that.
    """

    def __init__(self, folder: Path, head: Mapping[str, Any], *, anew: bool = False) -> None:
        """``anew``: drop those that are there, as those of another head are in any case. Raises BadInput, OSError."""
        folder.mkdir(parents=True, exist_ok=True)
        self.path, self._times, self._head = folder / RESULTS, folder / TIMES, dict(head)
        self._file = open(self.path, "a+b", opener=no_follow)  # noqa: SIM115 (close does it)
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self.close()
            raise BadInput(f"{self.path}: expected a campaign that nobody works on, got one that another process"
                           " works on") from None
        found, records = read_results(self.path)
        if anew or found != self._head:
            self._file.truncate(0)
            self._times.unlink(missing_ok=True)
            self._append(self._head)
            records = {}
        else:
            self._file.truncate(self.path.read_bytes().rfind(b"\n") + 1)  # up to the end of the last whole line
        measured = {times[CASE]: times.get("measured", {}) for times in read_times(folder)}
        self.known = {case: _with_measured(record[RESULT], measured.get(case, {}))
                      for case, record in records.items() if RESULT in record}

    def add(self, case: int, result: Mapping[str, Any], times: Mapping[str, Any]) -> None:
        """Append what was found of a case, and when and how; on the disk when this returns."""
        measured = {key: result[key] for key in MEASURED if key in result}
        with open(self._times, "a", encoding="utf-8", opener=no_follow) as out:
            out.write(json.dumps({CASE: case, "at": round(time.time(), 3), **times, "measured": measured}) + "\n")
        self._append({CASE: case, RESULT: {**result, **dict.fromkeys(measured)}})
        self.known[case] = dict(result)

    def give_up(self, case: int, kills: int) -> None:
        """Append that a case ended so many workers."""
        self._append({CASE: case, KILLED: kills})

    def sort(self) -> None:
        """Put the lines in the order of the cases; the file as it was stays until the new one is whole."""
        lines = (self._head, *read_results(self.path)[1].values())
        write_whole(self.path, "".join(json.dumps(line) + "\n" for line in lines), sync=True)
        sync_folder(self.path.parent)

    def close(self) -> None:
        """Let others work on it."""
        self._file.close()

    def _append(self, record: Mapping[str, Any]) -> None:
        self._file.write(json.dumps(record).encode() + b"\n")
        self._file.flush()
        os.fsync(self._file.fileno())


def read_results(path: Path) -> tuple[dict[str, Any], dict[int, dict[str, Any]]]:
    """The head, and the line of each case in the order of the cases; lines that cannot be read are left out.

    Of two results of a case the first counts; that it was given up counts only until there is a result. Raises BadInput
    for a result that is no object.
    """
    records = list(_read_lines(path))
    head = records[0] if records and CASE not in records[0] else {}
    found: dict[int, dict[str, Any]] = {}
    for record in records[1:]:
        case, result, kills = record.get(CASE), record.get(RESULT, {}), record.get(KILLED, 0)
        if not (isinstance(result, dict) and is_number(kills)):
            raise BadInput(f"{path}: case {case}: expected a JSON object as result, got {record.get(RESULT, kills)!r}")
        if isinstance(case, int) and (case not in found or RESULT not in found[case]):
            found[case] = record
    return head, {case: found[case] for case in sorted(found)}


def read_times(folder: Path) -> list[dict[str, Any]]:
    """What was measured, in the order in which the cases were done."""
    return [record for record in _read_lines(folder / TIMES)
            if isinstance(record.get(CASE), int) and isinstance(record.get("measured", {}), dict)]


def is_number(value: Any) -> bool:
    """Whether a value of JSON is a number that can be counted with."""
    return isinstance(value, int | float) and -1e15 < value < 1e15


def _with_measured(record: Mapping[str, Any], measured: Mapping[str, Any]) -> dict[str, Any]:
    """A result that is kept without what was measured, and that."""
    return {**record, **{key: measured.get(key, float("nan")) for key in MEASURED if key in record}}


def _read_lines(path: Path) -> Iterator[dict[str, Any]]:
    for line in read_regular(path, MOST_JOURNAL_BYTES).split(b"\n")[:-1] if path.is_file() else []:
        try:
            record = json.loads(line)
        except (ValueError, RecursionError):
            continue
        if isinstance(record, dict):
            yield record
