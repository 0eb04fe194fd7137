"""RecordingStream: the recording stream behind the loggers; it alone knows when what was logged reaches the disk."""

from __future__ import annotations

import ctypes
import os
import socket
import string
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path
from threading import Thread
from typing import Any, Protocol

import numpy as np
import pyarrow as pa
import rerun as rr

from logs.disk import no_follow
from logs.run_errors import RecordingError

pa.set_memory_pool(pa.system_memory_pool())  # arrow's own keeps 20 MB that a mission's recording gave back

APPLICATION = "harvey"
FLUSH_CYCLES, LIVE_FLUSH_CYCLES = 128, 4
"""A crash loses at most so many cycles of the recording (the journal loses none, so they can be drawn again); a live
viewer sees it so late."""
MOST_S = 5.0
"""So long it may take to bring what was logged to the disk: where that is full, the library may wait for ever [s]."""
LOCALHOST, LIVE_PORT = "127.0.0.1", 9876
BATCHING = rr.ChunkBatcherConfig(flush_tick=3600.0, flush_num_bytes=1 << 30, flush_num_rows=1 << 40)
"""The stream itself never flushes: what is in a chunk then follows from the cycles alone, and equal runs are equal."""
VERIFIED, REFUTED, TROUBLE = "✔", "✗", "⚠"
LATIN = "".join(map(chr, (*range(0xA1, 0xAD), *range(0xAE, 0x180))))
GREEK_AND_CYRILLIC = "".join(map(chr, (*range(0x3B1, 0x3CA), 0x3A9, *range(0x410, 0x450))))
SIGNS = frozenset(
    string.printable[:-2] + LATIN + GREEK_AND_CYRILLIC + "–—‘’“”…→≤−●▶" + VERIFIED + REFUTED + TROUBLE)
"""What may be shown."""
Batch = Sequence[Any] | np.ndarray[Any, Any]
"""The values of one component in one row: none, one or many."""
Row = tuple[int, float, dict[str, Batch]]
"""Cycle, simulated time and components."""


class Columnar(Protocol):
    """Makes columns of components: an archetype of rerun, or what acts like one."""

    def columns(self, *args: Any, **kwargs: Any) -> Iterable[Any]:
        """One column for each component."""


class Mixed:
    """Components of several archetypes in one row; what none of them has is a value under its own name."""

    def __init__(self, **kinds: Any) -> None:
        """``kinds``: component -> its archetype."""
        self._kinds = kinds

    def columns(self, **components: Any) -> Iterator[Any]:
        """One column for each component."""
        for name, values in components.items():
            kind = self._kinds.get(name)
            yield from kind.columns(**{name: values}) if kind else rr.AnyValues.columns(True, **{name: values})


class RecordingStream:
    """One recording: a file, a live server for a viewer, or both.

    Rows are kept and sent as columns once in a while: that costs a tenth of logging them one by one. It is only a
    drawing: once it cannot be written, it ends there, and nobody waits for it.
    """

    def __init__(
        self, path: Path | None, recording_id: str, title: str, blueprint: Any, *, live: bool = False,
        live_port: int = LIVE_PORT,
    ) -> None:
        if path is None and not live:
            raise ValueError("expected a path or live=True, got neither")
        if live:
            _expect_free_port(live_port)
        self._path, self._lost = path, ""
        self._stream = rr.RecordingStream(
            APPLICATION, recording_id=recording_id, send_properties=False, batcher_config=BATCHING)
        self._stream.set_log_time_enabled(False)
        self._stream.set_log_tick_enabled(False)
        sinks: list[Any] = [*([rr.FileSink(path)] if path is not None else []),
                 *([rr.GrpcServerSink(bind_ip=LOCALHOST, port=live_port)] if live else [])]
        if path is not None:
            self._try(lambda: os.close(no_follow(path, os.O_WRONLY | os.O_CREAT)))
        self._try(lambda: self._stream.set_sinks(*sinks, default_blueprint=blueprint))
        self._stream.send_recording_name(viewable(title))
        self._cycles, self._flush_cycles = 0, LIVE_FLUSH_CYCLES if live else FLUSH_CYCLES
        self._now = (0, 0.0)
        self._rows: dict[tuple[str, Columnar, tuple[str, ...]], list[Row]] = {}

    def at(self, cycle: int, sim_time_s: float) -> None:
        """What is logged from now on happened then."""
        self._now = cycle, sim_time_s

    def log(self, path: str, kind: Columnar, **components: Batch) -> None:
        """Log one row at an entity path, now; each component is a batch of values, which may be empty.

        Of a text the signs are left out that the viewer cannot show.
        """
        if self._lost:
            return
        shown = {name: [viewable(text) for text in batch]
                 if isinstance(batch, list | tuple) and batch and isinstance(batch[0], str) else batch
                 for name, batch in components.items()}
        self._rows.setdefault((path, kind, tuple(shown)), []).append((*self._now, shown))

    def fix(self, path: str, *what: Any) -> None:
        """Log archetypes that hold at all times."""
        if not self._lost:
            self._stream.log(path, what[0], *what[1:], static=True)

    def tell(self, **values: str | int | float) -> None:
        """Properties of the whole recording, by which a catalog of runs is searched: ``property:harvey:outcome``."""
        if not self._lost:
            self._stream.send_property(APPLICATION, rr.AnyValues(True, **values))

    def end_cycle(self) -> None:
        """Bring what was logged to the disk once in a while; where that fails, :meth:`close` tells."""
        self._cycles += 1
        if self._cycles % self._flush_cycles == 0:
            with suppress(RecordingError):
                self.flush()

    def flush(self) -> None:
        """Bring what was logged to the disk; raises RecordingError where that fails, or takes longer than MOST_S."""
        rows, self._rows = self._rows, {}
        if self._lost:
            raise RecordingError(self._lost)
        self._try(lambda: self._send(rows))

    def close(self) -> None:
        """End the recording with its footer. Raises RecordingError as :meth:`flush`."""
        self.flush()
        self._try(self._disconnect)

    def _send(self, kept: dict[tuple[str, Columnar, tuple[str, ...]], list[Row]]) -> None:
        for (path, kind, names), rows in kept.items():
            cycles, times_s, batches = zip(*rows, strict=True)
            index = [rr.TimeColumn("cycle", sequence=cycles), rr.TimeColumn("sim_time", duration=times_s)]
            columns = chain.from_iterable(_columns(kind, name, [batch[name] for batch in batches]) for name in names)
            self._stream.send_columns(path, index, columns)
        self._stream.flush(timeout_sec=MOST_S)

    def _disconnect(self) -> None:
        ending = Thread(target=self._stream.disconnect, daemon=True)  # it knows no time limit
        ending.start()
        ending.join(MOST_S)
        if ending.is_alive():
            raise OSError(f"it takes longer than {MOST_S:.0f} s")

    def _try(self, act: Callable[[], None]) -> None:
        try:
            act()
        except (RuntimeError, OSError, ValueError) as error:
            self._lost = f"{self._path or 'live recording'}: cannot be written: {error}"
            _let_go(self._stream)
            raise RecordingError(self._lost) from None


def _let_go(stream: rr.RecordingStream) -> None:
    """A stream that failed is neither flushed nor closed any more, also not at exit: either may wait for ever."""
    rr.unregister_shutdown()
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(stream))


def _columns(kind: Columnar, name: str, batches: Sequence[Batch]) -> Iterable[Any]:
    """A component's values, row by row."""
    lengths = [len(batch) for batch in batches]
    is_array = isinstance(batches[0], np.ndarray)
    values = np.concatenate(batches) if is_array else list(chain.from_iterable(batches))
    columns = kind.columns(**{name: values})
    return columns if lengths == [1] * len(lengths) else [column.partition(lengths) for column in columns]


def _expect_free_port(port: int) -> None:
    """The live server itself does not tell when somebody else listens there."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOCALHOST, port))
        except OSError as error:
            address = f"{LOCALHOST}:{port}"
            raise RecordingError(f"live recording: {address} cannot be served: {error.strerror}") from None


def viewable(text: str) -> str:
    """The text with "?" in place of each sign that the viewer cannot show."""
    return text if text.isascii() else "".join(sign if sign in SIGNS else "?" for sign in text)
