"""Results file: what is known of each case of a campaign, in JSON lines, one a case.

It is only appended to, and a line is on the disk before the next case is taken as done. The first line says whose
results these are. A kill may tear the last line; it is dropped then, and its case done again. What was measured of the
machine (seconds, worker) stands in a file of its own, so that the results are the same byte for byte whoever worked;
at the end the lines are put in the order of the cases.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from harvey.errors import BadInput

RESULTS, TIMES = "results.jsonl", "times.jsonl"
CASE, RESULT, KILLED = "case", "result", "killed"

Records = dict[int, dict[str, Any]]
"""By case."""


class ResultsFile:
    """The results of a campaign, open for more.

    Attributes:
        known: result by case.
    """

    def __init__(self, folder: Path, head: Mapping[str, Any]) -> None:
        """Open or begin it; use :func:`open_results`."""
        self.path, self._head = folder / RESULTS, dict(head)
        self._file = open(self.path, "a+b")  # noqa: SIM115 (it stays open; open_results closes it)
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._file.close()
            raise BadInput(f"{self.path}: expected a campaign that nobody works on, got one that another process"
                           " works on") from None
        found, records = read_results(self.path)
        self._times = folder / TIMES
        if found != self._head:
            self._file.truncate(0)
            self._times.unlink(missing_ok=True)
            self._append(self._head)
            records = {}
        else:
            self._file.truncate(_whole(self.path))
        self.known = {case: record[RESULT] for case, record in records.items() if RESULT in record}

    def add(self, case: int, result: Mapping[str, Any], times: Mapping[str, Any]) -> None:
        """Append what was found of a case; on the disk when this returns."""
        with self._times.open("a", encoding="utf-8") as out:
            out.write(_line({CASE: case, **times}).decode())
        self._append({CASE: case, RESULT: result})
        self.known[case] = dict(result)

    def give_up(self, case: int, kills: int) -> None:
        """Append that a case ended so many workers."""
        self._append({CASE: case, KILLED: kills})

    def sort(self) -> None:
        """Put the lines in the order of the cases; the file as it was stays until the new one is whole."""
        _, records = read_results(self.path)
        lines = [self._head, *(records[case] for case in sorted(records))]
        part = self.path.with_suffix(".part")
        with part.open("wb") as out:
            out.writelines(map(_line, lines))
            out.flush()
            os.fsync(out.fileno())
        os.replace(part, self.path)
        _sync_folder(self.path.parent)

    def close(self) -> None:
        """Let others work on it."""
        self._file.close()

    def _append(self, record: Mapping[str, Any]) -> None:
        self._file.write(_line(record))
        self._file.flush()
        os.fsync(self._file.fileno())


@contextmanager
def open_results(folder: Path, head: Mapping[str, Any]) -> Iterator[ResultsFile]:
    """The results in a folder, begun anew where they are of another head. Raises BadInput, OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    results = ResultsFile(folder, head)
    try:
        yield results
    finally:
        results.close()


def read_results(path: Path) -> tuple[dict[str, Any], Records]:
    """The head, and the line of each case in the order of the cases; lines that cannot be read are left out.

    Of two results of a case the first counts; that it was given up counts only until there is a result.
    """
    records = list(_read_lines(path))
    head = records[0] if records and CASE not in records[0] else {}
    found: Records = {}
    for record in records[1:]:
        case = record.get(CASE)
        if isinstance(case, int) and (case not in found or RESULT not in found[case]):
            found[case] = record
    return head, {case: found[case] for case in sorted(found)}


def read_times(folder: Path) -> list[dict[str, Any]]:
    """What was measured, in the order in which the cases were done."""
    return [record for record in _read_lines(folder / TIMES) if isinstance(record.get(CASE), int)]


def _read_lines(path: Path) -> Iterator[dict[str, Any]]:
    for line in path.read_bytes().split(b"\n")[:-1] if path.is_file() else []:
        try:
            record = json.loads(line)
        except ValueError:
            continue
        if isinstance(record, dict):
            yield record


def _whole(path: Path) -> int:
    """Bytes up to the end of the last line that is whole."""
    return path.read_bytes().rfind(b"\n") + 1


def _line(record: Mapping[str, Any]) -> bytes:
    return json.dumps(record).encode() + b"\n"


def _sync_folder(folder: Path) -> None:
    number = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)
