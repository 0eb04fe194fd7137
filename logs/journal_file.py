"""The journal on disk: one decision a line, written before anything follows from it."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from blackboard.journal import Decision, decision_line


class JournalError(ValueError):
    """A journal that cannot be read; names file and line."""


class JournalFile:
    """A scheduler's sink that writes ``journal.jsonl``.

    The scheduler calls its sinks before a port sees the decision: when this returns, the line is in the file (and, with
    ``sync``, on the disk), so that nothing reaches the motors that is not written down.
    """

    def __init__(self, path: Path, *, sync: bool = False) -> None:
        """Begin a new journal at ``path``; with ``sync`` every line is forced onto the disk.

        Raises:
            OSError: the file cannot be written.
        """
        self._path, self._sync = path, sync
        self._last: tuple[Decision, str] | None = None
        self._file = path.open("w", encoding="utf-8", newline="\n")

    def __call__(self, decision: Decision) -> None:
        """Write one line.

        Raises:
            OSError: the file cannot be written any more, as when the disk is full; names the file.
        """
        try:
            self._file.write(self.line(decision) + "\n")
            self._file.flush()
            if self._sync:
                os.fsync(self._file.fileno())
        except OSError as error:
            raise OSError(error.errno, f"cannot write the journal: {error.strerror}", str(self._path)) from error

    def line(self, decision: Decision) -> str:
        """A decision's line, without its newline; the last one is remembered."""
        if self._last is None or self._last[0] is not decision:
            self._last = decision, decision_line(decision)
        return self._last[1]

    def close(self) -> None:
        """No more decisions."""
        self._file.close()


def read_journal(path: Path) -> Iterator[dict[str, Any]]:
    """The decisions of a journal, one by one.

    A last line without its end, as a crash leaves it, is not a decision: it comes as ``{"truncated": <line number>}``.

    Raises:
        JournalError: a line is not a decision.
        OSError: the file cannot be read.
    """
    with path.open("rb") as file:
        for number, line in enumerate(file, 1):
            if not line.endswith(b"\n"):
                yield {"truncated": number}
                return
            yield _decision(line, f"{path}:{number}")


def _decision(line: bytes, where: str) -> dict[str, Any]:
    try:
        record = json.loads(line)
    except ValueError as error:
        raise JournalError(f"{where}: expected a decision as a JSON object, got {line[:60]!r} ({error})") from None
    if not isinstance(record, dict) or not isinstance(record.get("cycle"), int):
        raise JournalError(f'{where}: expected a JSON object with a number "cycle", got {line[:60]!r}')
    return record
