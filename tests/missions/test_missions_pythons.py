"""The same scenario and seed decide the same on every supported Python, byte for byte."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from elsewhere import ROOT, drive_elsewhere
from recorded_runs import Recorded


def _other_python() -> Path | None:
    """A Python of another version, in an environment made by ``make environment PYTHON=... VENV=.venv-...``."""
    own = f"{sys.version_info.major}.{sys.version_info.minor}"
    others = [path for path in sorted(ROOT.glob(".venv*/bin/python")) if _version(path) not in ("", own)]
    return others[0] if others else None


def _version(python: Path) -> str:
    asked = subprocess.run(
        [python, "-c", "import sys, rerun, numba; print('%d.%d' % sys.version_info[:2])"],
        capture_output=True, text=True, check=False,
    )
    return asked.stdout.strip()


def test_another_python_writes_the_same_journal(recorded: Recorded, tmp_path: Path) -> None:
    python = _other_python()
    if python is None:
        pytest.skip("no environment with another Python is here: make environment PYTHON=python3.13 VENV=.venv-3.13")
    drive_elsewhere(python, tmp_path)
    assert recorded("office").journal.read_bytes() == (tmp_path / "journal.jsonl").read_bytes()
