"""The lines of a journal."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from logs.records import read_records


def read_journal(path: Path) -> Iterator[Mapping[str, Any]]:
    """Each whole line as JSON types, after it was read as a decision."""
    return (record.data for record in read_records(path))
