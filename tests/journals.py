"""The lines of a journal, as they stand in it and in a recording, and what else a recording has."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from rerun.chunk import RrdReader

from logs.reader import read_series
from logs.recording.loggers.decisions import RECORD
from logs.recording.paths import RECORDS
from logs.timeline import Timeline


def read_journal(path: Path) -> Iterator[Mapping[str, Any]]:
    """Each whole line as JSON types, after it was read as a decision."""
    return (record.data for record in Timeline(path).decisions())


def read_decisions(recording: Path) -> list[dict[str, Any]]:
    """The decisions of a recording in their order."""
    return [json.loads(line) for _, line in read_series(recording, RECORDS, RECORD)]


def logged(recording: Path, entity: str, component: str) -> list[tuple[int, Any]]:
    """(cycle, value) of what was logged there."""
    rows = []
    for chunk in RrdReader(recording).stream().filter(content=f"/{entity}", is_static=False):
        batch = chunk.to_record_batch()
        if component in batch.schema.names:
            pairs = zip(batch.column("cycle").to_pylist(), batch.column(component).to_pylist(), strict=True)
            rows += [(cycle, value) for cycle, value in pairs if value is not None]
    return sorted(rows, key=lambda pair: pair[0])
