"""Tape: the recording stream behind the loggers; it alone knows when what was logged reaches the disk."""

from __future__ import annotations

import socket
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import rerun as rr

from logs.errors import RecordingError

APPLICATION = "harvey"

FLUSH_CYCLES = 15
"""A crash loses at most so many cycles of the recording (the journal loses none)."""

Row = tuple[int, float, dict[str, Any]]
"""Cycle, simulated time and fields."""

LOCALHOST, LIVE_PORT = "127.0.0.1", 9876

BATCHING = rr.ChunkBatcherConfig(flush_tick=3600.0, flush_num_bytes=1 << 30, flush_num_rows=1 << 40)
"""The stream itself never flushes: what is in a chunk then follows from the cycles alone, and equal runs are equal."""


class Tape:
    """One recording: a file, a live server for a viewer, or both."""

    def __init__(self, path: Path | None, recording_id: str, title: str, blueprint: Any, *, live: bool = False) -> None:
        if path is None and not live:
            raise ValueError("expected a path or live=True, got neither")
        if live:
            _expect_free_port()
        self._path = path
        self._stream = rr.RecordingStream(
            APPLICATION, recording_id=recording_id, send_properties=False, batcher_config=BATCHING)
        self._stream.set_log_time_enabled(False)
        self._stream.set_log_tick_enabled(False)
        self._guarded(lambda: self._stream.set_sinks(*_sinks(path, live), default_blueprint=blueprint))
        self._stream.send_recording_name(title)
        self._cycles = 0
        self._now = (0, 0.0)
        self._rows: dict[str, list[Row]] = {}

    def at(self, cycle: int, sim_time_s: float) -> None:
        """What is logged from now on happened then."""
        self._now = cycle, sim_time_s
        self._stream.set_time("cycle", sequence=cycle)
        self._stream.set_time("sim_time", duration=sim_time_s)

    def log(self, path: str, *what: Any) -> None:
        """Log archetypes at an entity path, now."""
        self._stream.log(path, what[0], *what[1:])

    def add(self, path: str, **fields: Any) -> None:
        """Log one row of a table, now; rows are sent together, which costs a fraction of logging them one by one.

        ``fields`` have the same names in each row of an entity; ``text`` and ``level`` make a text log.
        """
        self._rows.setdefault(path, []).append((*self._now, fields))

    def fix(self, path: str, *what: Any) -> None:
        """Log archetypes that hold at all times."""
        self._stream.log(path, what[0], *what[1:], static=True)

    def end_cycle(self) -> None:
        """Bring what was logged to the disk once in a while.

        Raises:
            RecordingError: the disk is full or gone.
        """
        self._cycles += 1
        if self._cycles % FLUSH_CYCLES == 0:
            self.flush()

    def flush(self) -> None:
        """Bring what was logged to the disk; raises RecordingError where that fails."""
        for path, rows in self._rows.items():
            cycles, times, fields = zip(*rows, strict=True)
            index = [rr.TimeColumn("cycle", sequence=cycles), rr.TimeColumn("sim_time", duration=times)]
            self._stream.send_columns(path, index, list(_columns(fields)))
        self._rows.clear()
        self._guarded(self._stream.flush)

    def close(self) -> None:
        """End the recording with its footer."""
        try:
            self.flush()
        finally:
            self._stream.disconnect()

    def _guarded(self, act: Any) -> None:
        try:
            act()
        except (RuntimeError, OSError, ValueError) as error:
            raise RecordingError(f"{self._path or 'live recording'}: cannot be written: {error}") from None


def _columns(rows: Sequence[dict[str, Any]]) -> Iterator[Any]:
    """Rows as columns."""
    fields = {name: [row[name] for row in rows] for name in rows[0]}
    if "text" in fields:
        yield from rr.TextLog.columns(text=fields.pop("text"), level=fields.pop("level"))
    if fields:
        yield from rr.AnyValues.columns(True, **fields)


def _expect_free_port() -> None:
    """The live server itself does not tell when somebody else listens there."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOCALHOST, LIVE_PORT))
        except OSError as error:
            address = f"{LOCALHOST}:{LIVE_PORT}"
            raise RecordingError(f"live recording: {address} cannot be served: {error.strerror}") from None


def _sinks(path: Path | None, live: bool) -> list[Any]:
    file = [rr.FileSink(path)] if path is not None else []
    return [*file, *([rr.GrpcServerSink(bind_ip=LOCALHOST, port=LIVE_PORT)] if live else [])]
