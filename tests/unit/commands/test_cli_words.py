"""Words, tables and reports of the command line."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from blackboard import Level, plain
from experiments.paper.levels import _row
from experiments.report import Report
from experiments.scale.render_speed import measure_edge_offsets_px
from harvey.campaign.summary import format_result, format_results
from harvey.dry_run import MilestonePreview, summarize_dry_run
from harvey.runner.result import MissionResult, format_error
from logs.explain.phrases import sentence
from logs.records import EntryRecord
from logs.tables import table
from world_models.entries import Discrepancy, Hypothesis, Leg, MotorCommand, Outcome, Track, Tracks, diagonal
from world_models.frames import Pose2
from world_models.words import degrees, metres, turn

FOUND = Track(
    "door-frame", (1.0, 2.0, 3.0), "CameraPicture-3", (10.0, 20.0), 2.5, (100.0, 80.0), (95.8, 81.5), 0.97, 0.1)


@pytest.mark.parametrize(("error_m", "text"), [
    (0.0033, "3.3 mm (0.13 inches)"), (13.1812, "13.18 m (43.2 feet)"), (math.nan, "not known")])
def test_an_error_is_told_in_units_of_its_size(error_m: float, text: str) -> None:
    assert format_error(error_m) == text


def say(value: Any) -> str:
    kind = type(value).__name__
    data = json.loads(json.dumps(plain(value)))
    return sentence(EntryRecord("Posted", f"{kind}-1.0", kind, "source", (), data, 1, False))


@pytest.mark.parametrize(("value", "told"), [
    (MotorCommand(math.radians(3.1), 0.61), "turn 3.1 degrees left and move 0.61 m ahead"),
    (MotorCommand(-0.1, 0.0), "turn 5.7 degrees right"),
    (MotorCommand(0.0, 0.05), "move 50 mm ahead"),
    (MotorCommand(0.0, 0.0), "stand still"),
    (Tracks("CameraPicture-4", 7, (FOUND,)),
     "1 of 1 landmark found again; in CameraPicture-4; door-frame 4.2 px left and 1.5 px below its prediction"
     " (correlation 0.97)"),
    (Hypothesis("hallway", Pose2(1.0, 2.0, math.pi / 2), diagonal(0.02, 0.01), "tracks"),
     "held: in hallway at (1.00, 2.00) m, heading 90.0 degrees; sigma 20 mm, 0.6 degrees, protection level"
     " 83 mm, by tracks"),
    (Discrepancy(Level.ACTION, "a bump", 5.0, (3.0, 9.0), "px"),
     "a bump: 5.00 px; discrepancy at the action level, where up to 3.00 px may be corrected; open"),
    (Discrepancy(Level.GOAL, "lost", math.inf, (3.0, 9.0), "px"),
     "lost: too large to be measured; discrepancy at the goal level; open"),
    (Leg("PlanSketch-2", 1, 0.0, 0.0, 3.0, 4.0, 0.1, increments=2),
     "straight leg of 5.00 m, moving after 2 increments; from (0.00, 0.00) m to (3.00, 4.00) m in the world (subgoal 1"
     " of PlanSketch-2, near enough within 100 mm)"),
])
def test_values_are_told_with_units(value: Any, told: str) -> None:
    assert say(value) == told


def test_numbers_are_told_as_people_read_them() -> None:
    assert degrees(-1e-9) == "0.0 degrees"
    assert turn(-math.pi / 2) == "90.0 degrees right"
    assert metres(0.0254) == "25 mm"
    assert metres("inf") == "inf m"


def test_a_table_aligns_numbers_right_and_words_left() -> None:
    shown = table(["seed", "how"], [["9", "reached"], ["10", "lost"], ["all", "1"]], last_is_summary=True)
    assert shown.splitlines() == ["seed  how", "-" * 13, "9     reached", "10    lost", "-" * 13, "all   1"]
    assert table(["n"], [["9"], ["10"]]).splitlines()[2:] == [" 9", "10"]


def ahead(*verdicts: str) -> list[MilestonePreview]:
    return [MilestonePreview("M", "hall", 0.0, 0.0, 0.0, 1, 9, 0.01, 0.01, verdict) for verdict in verdicts]


REACHED, BLOCKED = Outcome("reached", "all verified"), Outcome("blocked", "no way")


@pytest.mark.parametrize(("verdicts", "outcome", "told", "well"), [
    (("clear", "clear"), REACHED, "ends: reached, all verified", True),
    (("clear", "weak"), REACHED, "ends: reached, all verified; 1 milestone weak", True),
    (("clear", "ambiguous"), REACHED, "may not reach its goal: of 2 on the way, 1 milestone ambiguous", False),
    (("not testable", "not testable", "ambiguous"), REACHED,
     "may not reach its goal: of 3 on the way, 2 milestones not testable and 1 milestone ambiguous", False),
    ((), BLOCKED, "ends: blocked, no way", False),
    (("clear", "not testable"), BLOCKED, "ends: blocked, no way; 1 milestone not testable", False),
])
def test_what_is_foreseen_agrees_with_the_milestones(
    verdicts: tuple[str, ...], outcome: Outcome, told: str, well: bool
) -> None:
    assert summarize_dry_run(ahead(*verdicts), outcome) == (told, well)


def result(seed: int, outcome: str, error_m: float, collisions: int = 0) -> MissionResult:
    milestones = {"verified": 5, "refuted": 1, "not_testable": 0, "false_accepts": 0}
    return MissionResult(
        scenario="s", seed=seed, outcome=outcome, reason="so it was", goal="(ptrans)", final_error_m=error_m,
        final_heading_error_rad=0.0, path_length_m=20.0, sim_time_s=90.0, wall_time_s=10.0, frames=9, decisions=400,
        milestones=milestones, replans=2, relocalizations=0, sketches=3, collisions=collisions, max_cross_track_m=1.0,
    )


def test_missions_are_summed_up() -> None:
    assert "25.4 mm (1.00 inches) from the goal" in format_result(result(3, "reached", 0.0254), None)
    last = format_results([result(0, "reached", 0.01), result(1, "lost", 2.0, collisions=3)]).splitlines()[-1]
    assert "1 of 2 reached" in last
    assert "max 2000.0" in last
    assert last.split()[-5:] == ["3", "20.0", "90", "400", "10.0"]


def test_a_row_of_the_levels_tells_outcomes_and_errors() -> None:
    row = _row("s", "all on", [result(0, "reached", 0.01), result(1, "reached", 0.04), result(2, "lost", 1.0)])
    assert row[2:5] == (2, 1, "1 lost")
    assert row[5:9] == (pytest.approx(350.0), pytest.approx(1000.0), pytest.approx(1000.0), 0)


def test_a_report_holds_when_all_its_claims_do() -> None:
    report = Report("t", ("what", "paper", "ours"), (("x", None, 0.123456),), claims=(("a", True), ("b", False)))
    assert not report.holds
    assert "0.1235" in report.text() and "FAILS: b" in report.text() and "proved: a" in report.text()
    assert "not contradicted: a" in replace(report, is_small=True).text()
    assert report.record()["rows"] == [{"what": "x", "paper": None, "peer": None, "ours": 0.123456}]
    with pytest.raises(ValueError, match="expected 3 cells"):
        Report("t", ("what", "paper", "ours"), (("x", 1.0),))


def test_a_record_says_whose_each_figure_is() -> None:
    columns = ("way", "paper: E", "paper: pairs", "peer (PoseLib)", "ours", "ours, median")
    row, = Report("t", columns, (("one", 1.0, 2, 3.0, 4.0, 5.0),)).record()["rows"]
    assert (row["what"], row["paper"], row["peer"]) == ("one", {"paper: E": 1.0, "paper: pairs": 2}, 3.0)
    assert row["ours"] == 4.0 and row["ours, median"] == 5.0
    row, = Report("t", ("way", "fast", "slow"), (("one", 1.0, 2.0),)).record()["rows"]
    assert row["paper"] is row["peer"] is None and row["ours"] == {"fast": 1.0, "slow": 2.0}


@pytest.mark.parametrize("flat", [False, True])
def test_an_edge_is_found_where_it_is(flat: bool) -> None:
    rows, columns = np.mgrid[0:100, 0:80]
    edge = 30.3 + 0.2 * (rows - 10.0)
    image = 0.1 + 0.8 * np.clip(edge - columns + 0.5, 0.0, 1.0)
    ends = np.array([(30.3, 10.0), (46.3, 90.0)])
    image, ends = (image.T, ends[:, ::-1]) if flat else (image, ends)
    for shift_px in (0.0, 0.25):
        offsets = measure_edge_offsets_px(image, ends - ((0.0, shift_px) if flat else (shift_px, 0.0)))
        assert len(offsets) > 50
        assert np.allclose(offsets, shift_px, atol=1e-9)
