"""The short mission in a process of its own: with another Python, or with another board."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SEED = 3
PROGRAM = f"""
import sys
from pathlib import Path
from blackboard import scheduler
from sim.made_up.short_missions import OFFICE
from harvey.simulation.run import run_mission
from sim.stage import set_stage
from sim.scenario import parse_scenario
run_mission(set_stage(parse_scenario(OFFICE, "across-allens-office")), {SEED}, out=Path(sys.argv[1]))
print(scheduler.__file__)
"""


def drive_elsewhere(python: str | Path, out: Path, environment: Mapping[str, str] | None = None) -> str:
    """Drive it into a run directory; where the scheduler came from that decided."""
    done = subprocess.run(
        [python, "-P", "-c", PROGRAM, out], cwd=ROOT, env={**os.environ, **(environment or {})}, check=True,
        capture_output=True, text=True, timeout=1200,
    )
    return done.stdout.splitlines()[-1]
