"""Another package adds a knowledge source with its own kind of entry, a fault, a base and a logger: no edit here."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from elsewhere import ROOT

MISSION = """
world = "research_center"
details = ["research_center_details"]
goal = "(ptrans (hallway (4,4,0)) (hallway (20,4,0)))"
[[faults]]
kind = "slippery_floor"
after_ft = 4.0
slide_in = 2.0
"""
WRONG_KEY = MISSION.replace("slide_in", "turn_deg")


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder into which the example package was installed by pip."""
    folder = tmp_path_factory.mktemp("site")
    subprocess.run(
        [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--target", folder,
         ROOT / "examples" / "plugin"], check=True, capture_output=True, timeout=300)
    return folder


@pytest.fixture(scope="module")
def run(installed: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    (folder / "slide.toml").write_text(MISSION, encoding="utf-8")
    done = harvey(installed, "run", str(folder / "slide.toml"), "--out", str(folder / "run"))
    assert done.returncode == 0, done.stderr
    return folder / "run"


def python(installed: Path | None, *args: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join(str(folder) for folder in (ROOT, installed) if folder is not None)
    return subprocess.run([sys.executable, *args], env={**os.environ, "PYTHONPATH": path}, capture_output=True,
                          text=True, timeout=900)


def harvey(installed: Path | None, *args: str) -> subprocess.CompletedProcess[str]:
    return python(installed, "-m", "harvey.cli", *args)


def test_the_mission_has_the_foreign_entry_and_the_run_says_who_decided(run: Path) -> None:
    made = [entry for line in (run / "journal.jsonl").read_text(encoding="utf-8").splitlines()
            for entry in json.loads(line)["made"] if entry["type"] == "RunningShort"]
    assert [entry["author"] for entry in made] == ["timekeeper"]
    seated = json.loads((run / "run.json").read_text(encoding="utf-8"))["plugins"]
    assert {"timekeeper": "harvey-timekeeper 1.0"}.items() <= seated.items()  # and those of extras that are installed
    assert json.loads((run / "result.json").read_text(encoding="utf-8"))["amiss"] == []


def test_why_knows_it(installed: Path, run: Path) -> None:
    said = harvey(installed, "why", str(run), "RunningShort-1").stdout
    assert said.startswith("The battery runs short: ") and "by the timekeeper, woken by MotionReport-" in said
    asked = harvey(installed, "why", str(run), "--not", "timekeeper", "--at", "3").stdout
    assert "timekeeper watches for" in asked


def test_it_is_replayed_to_the_byte(installed: Path, run: Path) -> None:
    done = harvey(installed, "replay", str(run))
    assert done.returncode == 0, done.stdout + done.stderr


def test_without_the_package_a_replay_says_what_is_missing(run: Path) -> None:
    done = harvey(None, "replay", str(run))
    assert done.returncode == 2
    assert "expected the knowledge source 'timekeeper' of harvey-timekeeper 1.0" in done.stderr
    assert "Traceback" not in done.stderr


def test_without_the_package_why_tells_the_fields(run: Path) -> None:
    said = harvey(None, "why", str(run), "RunningShort-1")
    assert said.returncode == 0 and said.stdout.startswith("Left = ") and " s." in said.stdout


def test_the_recording_has_its_words(installed: Path, run: Path) -> None:
    code = ("import sys; from pathlib import Path; from logs.recording.paths import TABLE; from logs import reader;"
            "print([str(row) for row in reader._rows(Path(sys.argv[1]), TABLE, ('TextLog:text',))])")
    done = python(installed, "-c", code, str(run / "recording.rrd"))
    assert "timekeeper: the battery runs short: " in done.stdout, done.stderr


def test_the_recording_has_the_foreign_panel(installed: Path, run: Path) -> None:
    code = ("import sys; from pathlib import Path; from logs import reader;"
            "print(len(reader._rows(Path(sys.argv[1]), 'battery', ('Scalars:scalars',))))")
    done = python(installed, "-c", code, str(run / "recording.rrd"))
    assert int(done.stdout or "0") > 3, done.stderr


def test_its_source_keeps_the_laws_of_all_sources(installed: Path) -> None:
    done = python(installed, "-m", "pytest", "-p", "no:cacheprovider", str(ROOT / "examples" / "plugin" / "tests"))
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_generated_table_has_its_row(installed: Path) -> None:
    done = python(installed, str(ROOT / "docs" / "tools" / "knowledge_source_table.py"))
    assert "| `timekeeper` action |" in done.stdout, done.stderr
    assert "`timekeeper`" not in python(None, str(ROOT / "docs" / "tools" / "knowledge_source_table.py")).stdout


def test_a_foreign_fault_has_its_own_keys(installed: Path, tmp_path: Path) -> None:
    (tmp_path / "wrong.toml").write_text(WRONG_KEY, encoding="utf-8")
    done = harvey(installed, "run", str(tmp_path / "wrong.toml"), "--out", str(tmp_path / "run"))
    assert done.returncode == 2 and "turn_deg" in done.stderr and "wrong.toml:8" in done.stderr


def test_a_foreign_base_can_be_named(installed: Path) -> None:
    code = "from harvey.hardware.bases import kind_of; kind, url = kind_of('counting:/dev/null'); print(kind.name, url)"
    assert python(installed, "-c", code).stdout == "counting /dev/null\n"
    assert "expected denning:PORT" in python(None, "-c", code).stderr


def test_a_foreign_base_drives_a_mission_behind_its_own_emulator(installed: Path, run: Path, tmp_path: Path) -> None:
    scenario = run.parent / "slide.toml"
    done = harvey(installed, "run", str(scenario), "--body", "serial:counting", "--out", str(tmp_path / "run"))
    assert done.returncode == 0, done.stderr
    assert "expected one of simulated, serial:denning" in harvey(
        None, "run", "forty-foot-hallway", "--body", "serial:counting").stderr


def test_what_cannot_be_loaded_is_named(installed: Path, tmp_path: Path) -> None:
    info = tmp_path / "broken-0.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 0.1\n", encoding="utf-8")
    (info / "entry_points.txt").write_text("[harvey.knowledge_sources]\nnobody = nowhere:Nobody\n", encoding="utf-8")
    done = harvey(tmp_path, "run", "forty-foot-hallway", "--out", str(tmp_path / "run"))
    assert done.returncode == 2
    assert "broken 0.1: entry point harvey.knowledge_sources, nobody = nowhere:Nobody" in done.stderr
