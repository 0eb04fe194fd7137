"""``harvey export``: a run as tables for other programs."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

from harvey.commands.command import Command
from harvey.errors import BadInput
from logs.run_directory import open_run
from world_models.words import count


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", metavar="RUN", help="a run directory")
    parser.add_argument("--csv", metavar="DIR", help="write the tables there as CSV; older ones are overwritten")
    parser.add_argument("--parquet", metavar="DIR", help="write them there as Parquet")


def _run(args: Namespace) -> int:
    wanted = {kind: Path(folder) for kind in ("csv", "parquet") if (folder := getattr(args, kind)) is not None}
    if not wanted:
        raise BadInput("expected --csv DIR or --parquet DIR, got neither")
    from logs.export import read_tables, write_tables
    from logs.timeline import Timeline

    run = open_run(args.run)
    history = Timeline(run.journal)
    if not history.cycles:
        history.verify()
        raise BadInput(f"{run.journal}: expected at least one decision, got none")
    tables = list(read_tables(run, history))
    for kind, folder in wanted.items():
        for path, table in zip(write_tables(tables, kind, folder), tables, strict=True):
            print(f"{path}: {count(len(table.rows), 'row')}")
    return 0


COMMAND = Command(
    "export", "a run as tables for other programs: decisions, poses, milestones, turning points",
    (
        ("harvey export runs/lab-to-allens-office-0 --csv tables", "decisions.csv, poses.csv, milestones.csv, ..."),
        ("harvey export runs/lab-to-allens-office-0 --parquet tables", "the same for pandas, polars, DuckDB, Arrow"),
    ),
    _arguments, _run,
    "decisions: who acted in each cycle, woken by what; poses: each believed pose with its covariance, in its room's\n"
    "frame and in the world's; milestones: each verdict; turning_points; of a simulated run also truth: where the\n"
    "robot truly was, from the recording. Units stand at the end of each column's name: _m, _rad, _s.",
)
