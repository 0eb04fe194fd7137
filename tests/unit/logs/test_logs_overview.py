"""The overview of several runs: one row a run, made from their recordings."""

from pathlib import Path

import pytest
from rerun.chunk import RrdReader

from headless_viewer import look_or_skip
from logs.recording.loggers.lanes import GAP
from logs.recording.overview import FOUND, RunFiles, _marks, read_series, summary, write_overview
from logs.recording.paths import BUILDING, FLEET, HARVEY, MILESTONES, MOODS_OF, OFF, TRUE_ROBOT
from logs.recording.writer import RecordingWriter
from scripted_mission import CAMERA, MOUNT, house, play
from world_models.frames import Pose2

RESULT = {"scenario": "house", "seed": 3, "outcome": "reached", "final_error_m": 0.0042, "relocalizations": 0,
          "milestones": {"verified": 1, "refuted": 0}, "collisions": 0, "decisions": 25}


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[RunFiles]:
    """One run whose truth is known, and one on hardware."""
    folder = tmp_path_factory.mktemp("runs")
    files = []
    for name, knows in (("0", True), ("1", False)):
        recording = folder / f"{name}.rrd"
        recorder = RecordingWriter(
            recording, world=house(), camera=CAMERA, mount=MOUNT, title="house", recording_id=name)
        play([recorder], lambda n, d=recorder, k=knows: d.truth(Pose2(1.0 + 0.1 * n, 1.0, 0.0), 0.3 * n) if k else None)
        recorder.close()
        files.append(RunFiles(name, recording, RESULT if knows else {}))
    return files


@pytest.fixture(scope="module")
def overview(runs: list[RunFiles], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("overview") / "overview.rrd"
    assert write_overview(runs, path, "houses") == []
    return path


def test_each_run_has_its_row(overview: Path, runs: list[RunFiles]) -> None:
    for number, run in enumerate(runs):
        for root, source, component in ((MOODS_OF, HARVEY, "StateChange:state"),
                                        (FLEET, TRUE_ROBOT, "Transform3D:translation")):
            shown = read_series(overview, f"{root}/{number:03}_{run.name}", component.replace("Transform3D:translation",
                                                                                             "Points3D:positions"))
            known = read_series(run.recording, source, component)
            assert shown == known if known else shown
    assert read_series(overview, f"{MILESTONES}/000_0", "StateChange:state")[0][1] == "verified"


def test_errors_are_drawn_where_the_truth_is_known(overview: Path) -> None:
    assert read_series(overview, f"{OFF}/000_0", "Scalars:scalars")
    assert read_series(overview, f"{OFF}/001_1", "Scalars:scalars") == []


def test_the_building_comes_along(overview: Path) -> None:
    assert f"/{BUILDING}" in RrdReader(overview).store().schema().entity_paths()


def test_the_table_tells_how_they_ended(runs: list[RunFiles]) -> None:
    lines = summary(runs).splitlines()
    assert lines[0] == "**1 of 2 reached their goal.**"
    assert lines[4] == "0 | house | 3 | reached | 4.2 mm | 1 | 0 | 0 | 0 | 25"
    assert lines[5] == "1 | - | - | unfinished | - | - | - | - | - | -"


def test_a_mark_lasts_until_the_next_one() -> None:
    assert list(_marks([(1, "plan"), (2, "verified"), (4, "found"), (30, "refuted")])) == [
        (2, "verified"), (4, FOUND), (9, GAP), (30, "refuted"), (35, GAP)]


def test_a_damaged_recording_is_named_and_the_others_are_shown(runs: list[RunFiles], tmp_path: Path) -> None:
    broken = tmp_path / "broken.rrd"
    broken.write_bytes(runs[0].recording.read_bytes()[:5000])
    more = [RunFiles("broken", broken, {}), RunFiles("none", tmp_path / "none.rrd", {}), runs[0]]
    missing = write_overview(more, tmp_path / "overview.rrd", "houses")
    assert [line.split(": expected")[0] for line in missing] == [str(broken), str(tmp_path / "none.rrd")]
    assert read_series(tmp_path / "overview.rrd", f"{MOODS_OF}/000_0", "StateChange:state")


def test_no_runs_make_no_overview(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="expected at least one run"):
        write_overview([], tmp_path / "overview.rrd", "nothing")


def test_no_view_of_the_overview_reports_anything(overview: Path, tmp_path: Path) -> None:
    assert look_or_skip(overview, tmp_path, [10]) == []
