"""In a process of its own: the short mission with another Python, and wheels in a fresh environment."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SEED = 3
PROGRAM = f"""
import sys
from pathlib import Path
from experiments.generated.missions import OFFICE
from harvey.simulation.simulated_run import run_mission
from sim.stage import build_stage
from sim.scenario import parse_scenario
run_mission(build_stage(parse_scenario(OFFICE, "across-allens-office")), {SEED}, out=Path(sys.argv[1]))
"""


def drive_elsewhere(python: str | Path, out: Path) -> None:
    """Drive it into a run directory."""
    subprocess.run([python, "-P", "-c", PROGRAM, out], cwd=ROOT, check=True, capture_output=True, timeout=1200)


def install_elsewhere(folder: Path, *wheels: Path, with_needs: bool = True) -> Path:
    """A fresh environment with wheels; returns its packages. What these need are the packages of this environment, but
    for those of the project that are installed here.
    """
    venv.create(folder, with_pip=False)
    subprocess.run([sys.executable, "-m", "pip", "--python", folder / "bin" / "python", "install", "--quiet",
                    "--no-deps", "--no-index", *wheels], check=True, capture_output=True, timeout=300)
    site = Path(sysconfig.get_path("purelib", vars={"base": str(folder), "platbase": str(folder)}))
    if with_needs:
        needed = folder / "needed"
        needed.mkdir()
        for package in Path(sysconfig.get_path("purelib")).iterdir():
            if not package.name.startswith(("harvey", "__editable__")):
                (needed / package.name).symlink_to(package)
        (site / "needed.pth").write_text(f"{needed}\n", encoding="utf-8")
    return site


def build_wheel(source: Path, folder: Path) -> Path:
    """The wheel of a project."""
    subprocess.run([sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation",
                    "--wheel-dir", folder, source], check=True, capture_output=True, timeout=300)
    return next(folder.glob("harvey*.whl"))


def run_elsewhere(*command: str | Path, cwd: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run a program of such an environment, which does not find this one by its variables."""
    known = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
    return subprocess.run(command, cwd=cwd, env={**known, **variables}, capture_output=True, text=True, timeout=900)
