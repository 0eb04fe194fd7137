"""From a wheel: built, installed in a fresh environment, and used from a folder that has nothing of the project."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from elsewhere import ROOT, build_wheel, install_elsewhere, run_elsewhere

PACKAGES = ("blackboard", "world_models", "knowledge_sources", "sim", "logs", "harvey", "experiments")
FAKE_VIEWER = "#!/bin/sh\necho \"viewer: $1\"\n"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_wheel(ROOT, tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="module")
def environment(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fresh environment with the wheel, and a viewer that shows nothing."""
    folder = tmp_path_factory.mktemp("env") / "venv"
    site = install_elsewhere(folder, wheel)
    for package in PACKAGES:
        take_compiled_code_over(ROOT / package, site / package)
    viewer = folder / "bin" / "rerun"
    viewer.write_text(FAKE_VIEWER, encoding="utf-8")
    viewer.chmod(0o755)
    return folder


def take_compiled_code_over(source: Path, target: Path) -> None:
    """What numba has compiled of the same files here; else the first mission would take minutes to compile it again.

    numba finds its cache by a file's name, size and time of change.
    """
    for file in target.rglob("*.py"):
        same = source / file.relative_to(target)
        stat = same.stat()
        os.utime(file, ns=(stat.st_atime_ns, stat.st_mtime_ns))
        for compiled in (same.parent / "__pycache__").glob(f"{same.stem}.*.nb[ic]"):
            (file.parent / "__pycache__").mkdir(exist_ok=True)
            shutil.copy2(compiled, file.parent / "__pycache__")


def harvey(environment: Path, folder: Path, *args: str, **variables: str) -> subprocess.CompletedProcess[str]:
    return run_elsewhere(environment / "bin" / "harvey", *args, cwd=folder, **variables)


@pytest.fixture(scope="module")
def run(environment: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("elsewhere")
    done = harvey(environment, folder, "run", "forty-foot-hallway", "--seed", "1")
    assert done.returncode == 0, done.stderr
    return folder / "runs" / "forty-foot-hallway-1"


def test_the_wheel_has_the_packages_their_data_and_their_types(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.split("/")[0] for name in names if not name.startswith("harvey-")} == set(PACKAGES)
    assert {f"{package}/py.typed" for package in PACKAGES} <= set(names)
    for data in ("world_models/worlds/research_center.toml", "sim/scenarios/figure9.toml",
                 "harvey/report/page.html", "harvey/report/page.css", "harvey/report/page.js",
                 "knowledge_sources/methods/verification/verification_weights.toml"):
        assert data in names


def test_list(environment: Path, tmp_path: Path) -> None:
    done = harvey(environment, tmp_path, "list")
    assert done.returncode == 0 and "forty-foot-hallway" in done.stdout and "table1" in done.stdout


def test_a_run_leaves_its_files_where_one_stands(run: Path) -> None:
    assert {path.name for path in run.iterdir()} == {
        "run.json", "journal.jsonl", "camera.mjpeg", "recording.rrd", "result.json"}
    assert json.loads((run / "result.json").read_text(encoding="utf-8"))["outcome"] == "reached"


def test_the_same_decisions_as_in_the_source_tree(run: Path, tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-m", "harvey.cli", "run", "forty-foot-hallway", "--seed", "1", "--out", tmp_path],
                   cwd=ROOT, check=True, capture_output=True, timeout=900)
    assert (tmp_path / "journal.jsonl").read_bytes() == (run / "journal.jsonl").read_bytes()


def test_why_replay_and_view(environment: Path, run: Path, tmp_path: Path) -> None:
    why = harvey(environment, tmp_path, "why", str(run))
    assert why.returncode == 0 and "reached" in why.stdout
    assert harvey(environment, tmp_path, "replay", str(run)).returncode == 0
    view = harvey(environment, tmp_path, "view", str(run), DISPLAY=":99")
    assert view.returncode == 0 and f"viewer: {run / 'recording.rrd'}" in view.stdout


def test_a_folder_of_the_same_name_beside_a_program_is_named(environment: Path, tmp_path: Path) -> None:
    (tmp_path / "logs").mkdir()
    (tmp_path / "logs" / "__init__.py").write_text("", encoding="utf-8")
    done = run_elsewhere(environment / "bin" / "python", "-c", "import harvey", cwd=tmp_path)
    assert done.returncode == 1 and f"'logs' is hidden by {tmp_path / 'logs'}" in done.stderr
