"""Archive: every revision that was ever on a board, read back from its journal on disk.

The journal has each revision in full, in the line of the decision that made it or took it up. The archive keeps, in an
sqlite file beside it, at which byte that line begins; it is brought up to date when something is asked for, so it costs
a running board nothing, and it can be thrown away and made anew.
"""

from __future__ import annotations

import json
import sqlite3
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

TABLES = """
create table if not exists revisions (ref text primary key, start integer not null) without rowid;
create table if not exists reached (only_one integer primary key check (only_one = 0), start, stop, crc);
"""


class ArchiveError(ValueError):
    """A journal of which a line is not a decision; names file and byte."""


class Archive:
    """Finds revisions in a journal, one that is still being written as well. A context manager."""

    def __init__(self, journal: Path, index: Path | None = None) -> None:
        """Of a journal; ``index`` is where the places are kept, ``<journal>.index`` if not said.

        Raises:
            OSError: there is no such journal.
            sqlite3.Error: the index cannot be written.
        """
        self._journal = journal.open("rb")
        self._name = str(journal)
        self._index = sqlite3.connect(index or journal.with_name(f"{journal.name}.index"))
        self._index.executescript(TABLES)

    def read(self, ref: str) -> Mapping[str, Any] | None:
        """A revision such as ``Goal-1.0`` as the journal tells it, with the ``cycle`` of its line; None if it has none.

        Raises:
            ArchiveError: the journal has a line that is not a decision.
        """
        self._catch_up()
        found = self._index.execute("select start from revisions where ref = ?", (ref,)).fetchone()
        if found is None:
            return None
        self._journal.seek(found[0])
        decision = self._decision(self._journal.readline(), found[0])
        return next({"cycle": decision["cycle"], **told} for told in _told(decision) if told["entry"] == ref)

    def close(self) -> None:
        self._journal.close()
        self._index.close()

    def __enter__(self) -> Archive:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def _catch_up(self) -> None:
        """Take up the lines that have been written since."""
        start = self._reached()
        self._journal.seek(start)
        last: tuple[int, int, int] | None = None
        with self._index:
            for line in iter(self._journal.readline, b""):
                if not line.endswith(b"\n"):
                    break
                refs = [(told["entry"], start) for told in _told(self._decision(line, start))]
                self._index.executemany("insert or replace into revisions values (?, ?)", refs)
                last = start, start + len(line), zlib.crc32(line)
                start += len(line)
            if last is not None:
                self._index.execute("insert or replace into reached values (0, ?, ?, ?)", last)

    def _reached(self) -> int:
        """Up to which byte the journal is known; 0, and all forgotten, where it is not the journal that it was."""
        known = self._index.execute("select start, stop, crc from reached").fetchone()
        if known is None:
            return 0
        start, stop, crc = known
        self._journal.seek(start)
        if zlib.crc32(self._journal.read(stop - start)) == crc:
            return int(stop)
        with self._index:
            self._index.execute("delete from revisions")
            self._index.execute("delete from reached")
        return 0

    def _decision(self, line: bytes, start: int) -> Mapping[str, Any]:
        try:
            decision: Mapping[str, Any] = json.loads(line)
            dict(decision)["cycle"], list(_told(decision))
        except (ValueError, TypeError, KeyError) as error:
            where = f"{self._name}, byte {start}"
            raise ArchiveError(f"{where}: expected a decision, got {line[:60]!r} ({error})") from None
        return decision


def _told(decision: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """The revisions that stand in a line in full; a retraction makes none."""
    for key in ("observed", "made"):
        yield from (told for told in decision[key] if told["change"] != "Retracted")
