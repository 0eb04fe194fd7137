"""``harvey export``: what the journal tells comes back from CSV and Parquet to the last bit."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blackboard import decision_line
from harvey.cli import main
from logs import export
from logs.export import DECISIONS, MILESTONES, POSES, TRUTH, TURNS, Table, read_tables, write_csv, write_parquet
from logs.run_directory import RunDirectory
from logs.timeline import Timeline
from scripted_turns import HELD, decisions

CELLS = {
    str: st.none() | st.text(st.characters(exclude_categories=("Cs",), exclude_characters="\r\x00")),
    int: st.none() | st.integers(-(2**63), 2**63 - 1), float: st.none() | st.floats(allow_nan=False),
}


@st.composite
def tables(draw: st.DrawFn) -> Table:
    kinds = draw(st.lists(st.sampled_from([str, int, float]), min_size=1, max_size=5))
    rows = draw(st.lists(st.tuples(*(CELLS[kind] for kind in kinds)), max_size=6))
    return Table("made_up", tuple(f"column_{n}" for n in range(len(kinds))), tuple(kinds), rows)


def read_csv(path: Path, kinds: Sequence[type]) -> list[tuple[Any, ...]]:
    with path.open(encoding="utf-8", newline="") as file:
        _, *rows = csv.reader(file)
    return [tuple(None if cell == "" else kind(cell) for cell, kind in zip(row, kinds, strict=True)) for row in rows]


def read_parquet(path: Path) -> list[tuple[Any, ...]]:
    return [tuple(row.values()) for row in pq.read_table(path).to_pylist()]


@given(tables())
def test_each_cell_comes_back(tmp_path_factory: pytest.TempPathFactory, table: Table) -> None:
    folder = tmp_path_factory.mktemp("tables")
    assert read_parquet(write_parquet(table, folder)) == list(table.rows)
    if len(table.columns) > 1:  # a line with one empty cell is an empty line
        empty = [tuple(None if cell == "" else cell for cell in row) for row in table.rows]
        assert read_csv(write_csv(table, folder), table.kinds) == empty


@pytest.fixture
def run(tmp_path: Path) -> RunDirectory:
    run = RunDirectory(tmp_path / "run")
    run.path.mkdir()
    run.journal.write_text("".join(decision_line(decision) + "\n" for decision in decisions()), encoding="utf-8")
    return run


def test_the_tables_hold_what_the_journal_tells(run: RunDirectory) -> None:
    decided, poses, milestones, turns = read_tables(run, Timeline(run.journal))
    assert [row[0] for row in decided.rows] == list(range(1, 9))
    assert [dict(zip(POSES, row, strict=True))["entry"] for row in poses.rows] == ["Hypothesis-1.0", "Hypothesis-1.1"]
    first = dict(zip(poses.columns, poses.rows[0], strict=True))
    assert (first["x_m"], first["y_m"], first["sigma_m"]) == (1.0, 2.0, pytest.approx(HELD.sigma_m))
    assert first["cov_xx"] == HELD.covariance[0][0] and first["world_x_m"] is None  # of a run without its world
    assert [(row[0], row[3]) for row in milestones.rows] == [(2, "refuted")]
    assert [row[2] for row in turns.rows] == ["refuted", "lost", "found", "fault", "the end"]
    for table, columns in zip((decided, poses, milestones, turns), (DECISIONS, POSES, MILESTONES, TURNS), strict=True):
        for row in table.rows:
            for cell, kind in zip(row, columns.values(), strict=True):
                assert cell is None or isinstance(cell, kind)


def test_the_command_writes_both_and_says_how_much(run: RunDirectory, capsys: pytest.CaptureFixture[str]) -> None:
    out = run.path.parent / "tables"
    assert main(["export", str(run.path), "--csv", str(out), "--parquet", str(out)]) == 0
    names = {f"{name}.{kind}" for name in ("decisions", "poses", "milestones", "turning_points")
             for kind in ("csv", "parquet")}
    assert {path.name for path in out.iterdir()} == names
    assert f"{out / 'decisions.csv'}: 8 rows\n" in capsys.readouterr().out


@pytest.mark.parametrize("journal", [b"", b"\x00" * 100, b"{}\n", b"foreign\n"])
def test_what_cannot_be_exported_is_one_error(
    run: RunDirectory, journal: bytes, capsys: pytest.CaptureFixture[str]
) -> None:
    run.journal.write_bytes(journal)
    assert main(["export", str(run.path), "--csv", str(run.path.parent / "tables")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1 and not (run.path.parent / "tables").exists()


def test_both_ways_are_told_as_tum_once_a_time(tmp_path: Path, run: RunDirectory) -> None:
    told = (7.0, "held", 1.5), (1.0, "held", 1.5), (3.0, "candidate", 1.5), (0.5, "held", 0.25)
    rows = [tuple((dict.fromkeys(POSES) | {"world_x_m": x, "world_y_m": 2.0, "world_heading_rad": 0.0, "status": status,
                                           "time_s": time_s}).values()) for x, status, time_s in told]
    there = Table("truth", tuple(TRUTH), (), [(3, 1.5, 1.0, 2.0, np.pi)])
    both = [Table("poses", tuple(POSES), (), rows), there]
    assert [count for _, count in export.write_ways(both, tmp_path / "way.tum")] == [2, 1]
    believed, true = (np.loadtxt(tmp_path / f"way{which}.tum", ndmin=2) for which in ("", "-truth"))
    assert believed.tolist() == [[0.25, 0.5, 2, 0, 0, 0, 0, 1], [1.5, 1, 2, 0, 0, 0, 0, 1]]
    assert true[0].tolist() == pytest.approx([1.5, 1, 2, 0, 0, 0, 1, 0])
    assert main(["export", str(run.path), "--tum", str(tmp_path / "x.tum")]) == 2  # a run without its world


def test_where_it_cannot_be_written_is_one_error(run: RunDirectory, capsys: pytest.CaptureFixture[str]) -> None:
    for kind in ("--csv", "--parquet"):
        assert main(["export", str(run.path), kind, str(run.journal)]) == 2
        assert f"{kind} {run.journal}: expected a directory to write to" in capsys.readouterr().err
    assert main(["export", str(run.path)]) == 2
    assert "expected --csv DIR, --parquet DIR" in capsys.readouterr().err
