"""`make wheels`: core, board and every extra; core and extras installed beside one another in a fresh environment."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

from elsewhere import ROOT

EXTRAS = sorted(path.parent.name for path in ROOT.glob("extras/*/pyproject.toml"))


def test_the_wheels_of_core_and_extras_are_installed_together_and_find_one_another(tmp_path: Path) -> None:
    wheels, prepared = tmp_path / "wheels", f"{sys.prefix}/.ready-to-test"
    subprocess.run(["make", "-o", prepared, "wheels", f"VENV={sys.prefix}", f"WHEELS={wheels}"], cwd=ROOT, check=True,
                   capture_output=True, timeout=600)
    built = {path.name.split("-")[0].replace("_", "-"): path for path in wheels.glob("*.whl")}
    assert sorted(built) == sorted(["harvey", "harvey-board", *EXTRAS])
    folder = tmp_path / "venv"
    venv.create(folder, with_pip=False)
    python = folder / "bin" / "python"
    together = [path for name, path in built.items() if name != "harvey-board"]  # the core has the board already
    subprocess.run([sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-deps", "--no-index",
                    *together], check=True, capture_output=True, timeout=300)
    site = Path(sysconfig.get_path("purelib", vars={"base": str(folder), "platbase": str(folder)}))
    (site / "needed.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    known = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
    done = subprocess.run([folder / "bin" / "harvey", "follow", "--help"], cwd=tmp_path, env=known, capture_output=True,
                          text=True, timeout=300)
    assert done.returncode == 0 and "--world" in done.stdout, done.stderr
    code = "; ".join(f"import {name.replace('-', '_')} as m; print(m.__file__)" for name in EXTRAS)
    found = subprocess.run([python, "-c", code], cwd=tmp_path, env=known, capture_output=True, text=True, timeout=300)
    assert len(re.findall(re.escape(str(site)), found.stdout)) == len(EXTRAS), found.stderr


def test_the_container_names_no_registry() -> None:
    said = (ROOT / "Containerfile").read_text(encoding="utf-8")
    assert re.findall(r"^FROM (.+)$", said, re.MULTILINE) == ["python:3.12-slim"] and "://" not in said
