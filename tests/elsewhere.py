"""Drive the short mission in a process of its own, with another Python."""

from __future__ import annotations

import subprocess
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
