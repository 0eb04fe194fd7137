"""``harvey report`` of a campaign, and of runs beside each other: its table, its columns, what it refuses."""

from __future__ import annotations

import json
import re
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blackboard import decision_line
from harvey.cli import main
from harvey.report.drawing import read_fields
from scripted_turns import decisions

HOSTILE = "</script><b>lost</b> \u2028 {{rows}}"
NUMBERS = st.none() | st.integers() | st.floats() | st.booleans() | st.text(max_size=60)


def result(seed: int, **otherwise: Any) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    error_m = float(rng.lognormal(-5.0, 0.8))
    return {"scenario": "stroll", "seed": seed, "outcome": "lost" if seed % 3 == 0 else "reached",
            "reason": f"for the {seed}th reason", "final_error_m": error_m, "sim_time_s": float(rng.normal(60.0, 9.0)),
            "probes": int(rng.integers(0, 6)), "milestones": {"refuted": int(rng.integers(0, 3))}, "contacts": [],
            "collisions": 0} | otherwise


def write_campaign(folder: Path, results: list[dict[str, Any]]) -> None:
    folder.mkdir(parents=True)
    lines = [{"code": "x"}, *({"case": number, "result": one} for number, one in enumerate(results))]
    (folder / "results.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")


def write_run(folder: Path) -> None:
    folder.mkdir(parents=True)
    (folder / "journal.jsonl").write_text("".join(decision_line(d) + "\n" for d in decisions()), encoding="utf-8")


def cells(page: str) -> list[list[str]]:
    body = page[page.index('<table id="all">'):]
    return [[unescape(re.sub(r"<[^>]*>", "", cell)) for cell in re.findall(r"<t[dh].*?</t[dh]>", row)]
            for row in re.findall(r"<tr>(.*?)</tr>", body)]


@given(st.lists(st.dictionaries(st.sampled_from(["outcome", "error_m", "a_rad", "b"]), NUMBERS), max_size=6))
def test_every_value_that_is_known_is_in_a_column_or_the_same_of_all(results: list[dict[str, Any]]) -> None:
    columns, same = read_fields(results)
    assert all(len(column.values) == len(results) for column in columns)
    labels = {"outcome": "outcome", "error_m": "error", "a_rad": "a", "b": "b"}
    for key, label in labels.items():
        known = {str(one.get(key)) for one in results} - {"None", "nan"}
        told = [name for name in (*(column.label for column in columns), *same) if name.split(" ")[0] == label]
        assert len(told) <= 1 and (not known or told or all(
            one.get(key) is None or one.get(key) != one.get(key) for one in results))


def test_units_are_told_and_numbers_are_in_them() -> None:
    columns, same = read_fields([{"final_error_m": 0.0125, "off_rad": np.pi / 2, "v_m_per_s": 0.5, "probes": 3},
                                 {"final_error_m": None, "off_rad": 0.0, "v_m_per_s": 0.5, "probes": 4}])
    assert [(one.label, one.cell(0)) for one in columns] == [
        ("final error mm", "12.50"), ("off deg", "90.00"), ("probes", "3")]
    assert same == {"v m/s": "0.50"} and columns[0].cell(1) == ""


def test_a_campaign_of_a_hundred_is_a_table_with_distributions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    results = [result(seed) for seed in range(100)]
    results[5]["reason"] = HOSTILE
    write_campaign(tmp_path / "runs" / "stroll", results)
    assert main(["report", "stroll"]) == 0 and "stroll.html" in capsys.readouterr().out
    page = (tmp_path / "stroll.html").read_text(encoding="utf-8")
    assert len(page) < 5e6 and page.count("<script>") == 1 and HOSTILE not in page
    head, *rows = cells(page)
    assert head[:3] == ["mission", "outcome", "final error mm"] and head[-1] == "reason"
    assert [row[:2] for row in rows] == [[f"stroll, seed {one['seed']}", one["outcome"]] for one in results]
    assert rows[5][-1] == HOSTILE
    assert [row[2] for row in rows] == [f"{1e3 * one['final_error_m']:.2f}" for one in results]
    assert page.count("<svg") == 4 and "probes: median" in page and "collisions, of all: 0" in page
    assert '<th scope="row">lost</th><td>34</td><td>34.0</td><td>24.8 to 44.2</td>' in page
    assert set(re.findall(r"https?://[^\"' <)]+", page)) <= {
        "http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}
    assert "default-src 'none'" in page and not re.search(r"<(link|iframe|object|embed)\b|@import|src=", page)
    assert main(["report", "stroll", "--out", "again.html"]) == 0
    assert (tmp_path / "again.html").read_text(encoding="utf-8") == page


def test_names_lead_to_the_runs_own_reports(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("one", "two"):
        write_run(tmp_path / name)
    assert main(["report", "one", "two", "--out", "both.html"]) == 0
    assert "<a href=\"one" not in (tmp_path / "both.html").read_text(encoding="utf-8")
    assert main(["report", "one"]) == 0 and main(["report", "one", "two", "--out", "both.html"]) == 0
    page = (tmp_path / "both.html").read_text(encoding="utf-8")
    assert '<a href="one.html">one</a>' in page and 'scope="row">two</th>' in page
    (tmp_path / "two.html").write_text("<title>another</title>", encoding="utf-8")  # not the report of that run
    assert main(["report", "one", "two", "--each", "--out", "both.html"]) == 0
    page = (tmp_path / "both.html").read_text(encoding="utf-8")
    links = re.findall(r'<a href="([^#"]+)">(\w+)</a>', page)
    assert links == [("both-runs/one.html", "one"), ("both-runs/two.html", "two")]
    assert all(f"<title>{name}</title>" in (tmp_path / link).read_text(encoding="utf-8") for link, name in links)


def test_a_run_that_cannot_be_reported_is_named_and_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_run(tmp_path / "one")
    (tmp_path / "two").mkdir()
    (tmp_path / "two" / "journal.jsonl").write_text("foreign\n", encoding="utf-8")
    assert main(["report", "one", "two", "--each"]) == 0
    assert capsys.readouterr().err.startswith("two: no report: ") and (tmp_path / "one-runs" / "one.html").is_file()


@pytest.mark.parametrize(("argv", "said"), [
    (["nowhere"], "expected a run directory"),
    (["one", "nowhere"], "expected a run directory"),
    (["one", "--each"], "--each: expected several runs or a campaign"),
    (["empty"], "expected at least one mission that has ended"),
    (["odd"], "case 0: expected a JSON object"),
    (["empty", "--out", "page.pdf"], "--out: expected a name that ends in .html"),
])
def test_what_cannot_be_reported_is_one_error(
    argv: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_run(tmp_path / "one")
    write_campaign(tmp_path / "empty", [])
    write_campaign(tmp_path / "odd", [3])  # type: ignore[list-item]
    assert main(["report", *argv]) == 2
    error = capsys.readouterr().err
    assert said in error and len(error.splitlines()) == 1 and not [*tmp_path.glob("*.html")]

