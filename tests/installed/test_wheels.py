"""`make wheels`: core, board and every extra; core and extras installed beside one another in a fresh environment."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from elsewhere import ROOT, install_elsewhere, run_elsewhere

EXTRAS = sorted(path.parent.name for path in ROOT.glob("extras/*/pyproject.toml"))


def test_the_wheels_of_core_and_extras_are_installed_together_and_find_one_another(tmp_path: Path) -> None:
    wheels, prepared = tmp_path / "wheels", f"{sys.prefix}/.ready-to-test"
    subprocess.run(["make", "-o", prepared, "wheels", f"VENV={sys.prefix}", f"WHEELS={wheels}"], cwd=ROOT, check=True,
                   capture_output=True, timeout=600)
    built = {path.name.split("-")[0].replace("_", "-"): path for path in wheels.glob("*.whl")}
    assert sorted(built) == sorted(["harvey", "harvey-board", *EXTRAS])
    folder = tmp_path / "venv"
    together = [path for name, path in built.items() if name != "harvey-board"]  # the core has the board already
    site = install_elsewhere(folder, *together)
    done = run_elsewhere(folder / "bin" / "harvey", "follow", "--help", cwd=tmp_path)
    assert done.returncode == 0 and "--world" in done.stdout, done.stderr
    code = "; ".join(f"import {name.replace('-', '_')} as m; print(m.__file__)" for name in EXTRAS)
    found = run_elsewhere(folder / "bin" / "python", "-c", code, cwd=tmp_path)
    assert len(re.findall(re.escape(str(site)), found.stdout)) == len(EXTRAS), found.stderr


def test_the_container_names_no_registry() -> None:
    said = (ROOT / "Containerfile").read_text(encoding="utf-8")
    assert re.findall(r"^FROM (.+)$", said, re.MULTILINE) == ["python:3.12-slim"] and "://" not in said
