"""The lines of a journal, as they stand in it and in a recording."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from logs.reader import read_series
from logs.recording.loggers.decisions import RECORD
from logs.recording.paths import RECORDS
from logs.records import read_records


def read_journal(path: Path) -> Iterator[Mapping[str, Any]]:
    """Each whole line as JSON types, after it was read as a decision."""
    return (record.data for record in read_records(path))


def read_decisions(recording: Path) -> list[dict[str, Any]]:
    """The decisions of a recording in their order."""
    return [json.loads(line) for _, line in read_series(recording, RECORDS, RECORD)]
