"""Tables written as CSV and as Parquet. Numbers come back as they were, to the last bit."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from harvey.errors import BadInput
from harvey.export.tables import Table


def write_csv(table: Table, folder: Path) -> Path:
    """``NAME.csv``, in UTF-8, its first line the columns; what is not known is empty. Raises OSError."""
    path = folder / f"{table.name}.csv"
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table.columns)
        writer.writerows(table.rows)  # of a float the shortest text that reads back as it
    return path


def write_parquet(table: Table, folder: Path) -> Path:
    """``NAME.parquet``; what is not known is null. Raises OSError."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    types: Mapping[type, Any] = {str: pa.string(), int: pa.int64(), float: pa.float64(), bool: pa.bool_()}
    columns = zip(*table.rows, strict=True) if table.rows else ((),) * len(table.columns)
    arrays = [pa.array(cells, types[kind]) for cells, kind in zip(columns, table.kinds, strict=True)]
    path = folder / f"{table.name}.parquet"
    pq.write_table(pa.table(arrays, names=list(table.columns)), path)
    return path


WRITERS: Mapping[str, Callable[[Table, Path], Path]] = {"csv": write_csv, "parquet": write_parquet}


def write_tables(tables: Iterable[Table], kind: str, folder: Path) -> list[Path]:
    """All of them, in a folder that is made where there is none. Raises BadInput where it cannot be written to."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return [WRITERS[kind](table, folder) for table in tables]
    except OSError as error:
        raise BadInput(f"--{kind} {folder}: expected a directory to write to, got: {error.strerror or error}") from None
