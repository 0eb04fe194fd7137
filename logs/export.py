"""A run as tables for other programs, as CSV and as Parquet: decisions, believed poses with their covariance,
milestones, turning points, and the true poses. Numbers come back as they were, to the last bit. Both ways
in TUM's format as well."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from logs.explain.story import MilestoneRow, read_milestones
from logs.explain.turning_points import read_turning_points
from logs.reader import read_true_track
from logs.run_directory import RunDirectory
from logs.run_errors import BadInput
from logs.run_head import SIMULATOR, RunHead
from logs.timeline import Timeline
from world_models.building.world import World
from world_models.entries import Hypothesis
from world_models.plugins import RUN_EXPORTERS_GROUP, list_absent, load_plugins

Cell = str | int | float | bool | None
SEPARATOR = " "
"""Between the names of entries in one cell: names have no blank."""


@dataclass(frozen=True, slots=True)
class Table:
    """One table.

    Attributes:
        name: of its file.
        columns: their names end in their unit: _m, _rad, _s.
        kinds: of each column: str, int, float or bool; a cell may be None too, where nothing is known.
        rows: as many cells as columns.
    """

    name: str
    columns: tuple[str, ...]
    kinds: tuple[type, ...]
    rows: Sequence[tuple[Cell, ...]]


DECISIONS: Mapping[str, type] = {
    "cycle": int, "time_s": float, "level": str, "knowledge_source": str, "trigger": str, "rating": float,
    "pending": int, "observed": str, "made": str, "refused": str}
POSES: Mapping[str, type] = {
    "cycle": int, "time_s": float, "entry": str, "locale": str, "x_m": float, "y_m": float, "heading_rad": float,
    "sigma_m": float, "sigma_rad": float, "protection_m": float, "protection_rad": float, "cov_xx": float,
    "cov_xy": float, "cov_xh": float, "cov_yy": float, "cov_yh": float, "cov_hh": float,
    "basis": str, "status": str, "weight": float, "world_x_m": float, "world_y_m": float, "world_heading_rad": float}
"""Pose and covariance are in the locale's frame; h is the heading."""
MILESTONES: Mapping[str, type] = {
    "cycle": int, "time_s": float, "name": str, "verdict": str, "expected": int, "matched": int,
    "deviation_m": float, "deviation_rad": float, "p_wrong": float, "most_p_wrong": float, "entries": str}
TURNS: Mapping[str, type] = {"cycle": int, "time_s": float, "kind": str, "text": str}
TRUTH: Mapping[str, type] = {
    "cycle": int, "time_s": float, "world_x_m": float, "world_y_m": float, "world_heading_rad": float}


def read_tables(run: RunDirectory, history: Timeline) -> Iterator[Table]:
    """All of them; the true poses only of a simulated run that has its recording.

    Raises:
        BadInput, RecordingError: the journal or the recording cannot be read.
    """
    try:
        head: RunHead | None = RunHead.read(run.path)
    except BadInput:
        head = None
    tables: dict[str, tuple[Mapping[str, type], Sequence[tuple[Cell, ...]]]] = {
        "decisions": (DECISIONS, [*_decisions(history)]), "poses": (POSES, [*_poses(history, _world(head))]),
        "milestones": (MILESTONES, [_milestone(row) for row in read_milestones(history)]),
        "turning_points": (TURNS, [(p.cycle, p.time_s, p.kind, p.text) for p in read_turning_points(history)])}
    if head is not None and head.kind == SIMULATOR and run.recording.is_file():
        track = read_true_track(run.recording)
        tables["truth"] = TRUTH, [(cycle, history.time_at(cycle), *pose) for cycle, *pose in track]
    for name, (columns, rows) in tables.items():
        yield Table(name, tuple(columns), tuple(columns.values()), rows)


def _decisions(history: Timeline) -> Iterator[tuple[Cell, ...]]:
    for decision in history.decisions():
        chosen = decision.chosen
        who = (None, None, None) if chosen is None else (chosen.source, chosen.trigger, chosen.rating)
        observed, made = (SEPARATOR.join(one.ref for one in some) for some in (decision.observed, decision.made))
        yield (decision.cycle, history.time_at(decision.cycle), decision.focus, *who, decision.pending, observed, made,
               decision.refused)


def _poses(history: Timeline, world: World | None) -> Iterator[tuple[Cell, ...]]:
    for record in history.of_kind(Hypothesis):
        value = record.value
        pose, (xx, xy, xh), (_, yy, yh), (_, _, hh) = value.locale_from_robot, *value.covariance
        there = None if world is None else value.world_from_robot(world)
        in_world = (None, None, None) if there is None else (there.x_m, there.y_m, there.heading_rad)
        yield (record.cycle, history.time_at(record.cycle), record.ref, value.locale, pose.x_m, pose.y_m,
               pose.heading_rad, value.sigma_m, value.sigma_rad, value.protection_m, value.protection_rad, xx, xy, xh,
               yy, yh, hh, value.basis, value.status, value.weight, *in_world)


def _milestone(row: MilestoneRow) -> tuple[Cell, ...]:
    *cells, refs = (getattr(row, field.name) for field in fields(row))
    return (*cells, SEPARATOR.join(refs))


def _world(head: RunHead | None) -> World | None:
    """The world of the run; None where its file is not as it was, so that nothing is placed in another."""
    try:
        return None if head is None else head.load_world()
    except BadInput:
        return None


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


def write_ways(tables: Iterable[Table], path: Path) -> Iterator[tuple[Path, int]]:
    """The poses that were held, and the true ones beside them where they are known, in TUM's format; each file with
    its number of poses.

    Raises BadInput where none is placed in the world, or a file cannot be written.
    """
    for table in tables:
        if table.name not in ("poses", "truth"):
            continue
        rows = [dict(zip(table.columns, row, strict=True)) for row in table.rows]
        poses = {row["time_s"]: tuple(row[name] for name in tuple(TRUTH)[2:]) for row in rows
                 if row.get("status", "held") == "held" and None not in (row["time_s"], row["world_x_m"])}
        if not poses:
            raise BadInput(f"--tum {path}: expected poses with their times in a known world, got none")
        out = path if table.name == "poses" else path.with_stem(f"{path.stem}-truth")
        yield out, write_tum(poses.items(), out)


def write_tum(poses: Iterable[tuple[Any, tuple[Any, ...]]], path: Path) -> int:
    """Times [s] with x, y [m] and heading [rad] as lines of TUM's format, ``time x y z qx qy qz qw``, in the order of
    time; returns their number. Raises BadInput where the file cannot be written."""
    lines = [f"{time_s:.6f} {x_m:.6f} {y_m:.6f} 0 0 0 {math.sin(turn_rad / 2.0):.9f} {math.cos(turn_rad / 2.0):.9f}\n"
             for time_s, (x_m, y_m, turn_rad) in sorted(poses, key=lambda one: one[0])]
    try:
        path.write_text("".join(lines), encoding="utf-8")
    except OSError as error:
        raise BadInput(f"{path}: expected a file to write to, got: {error.strerror}") from None
    return len(lines)


@dataclass(frozen=True, slots=True)
class RunExporter:
    """What writes a run as one file for other programs: an extra brings it.

    Attributes:
        write: writes a run there, and returns the number of messages; raises BadInput and RecordingError.
    """

    write: Callable[[RunDirectory, Path], int]


def find_run_exporter(name: str) -> RunExporter:
    """The one of this name. Raises BadInput, which says what to install, where there is none."""
    if needs := list_absent(RUN_EXPORTERS_GROUP).get(name):
        raise BadInput(f"--{name} needs {needs}")
    exporter: RunExporter = load_plugins(RUN_EXPORTERS_GROUP, RunExporter, name)[name]
    return exporter
