"""The loads of the agenda with the board compiled, each measured in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np

from blackboard import scheduler
from harvey.experiments.agenda_load import LOADS, Load, Speed, measure


def measure_compiled(folder: Path, load: Load, pending: int, parts: int, seed: int) -> Speed:
    """As :func:`harvey.experiments.agenda_load.measure`, with what :func:`harvey.compiled.compile_board` wrote."""
    asked = [sys.executable, "-P", "-m", __name__, load.name, str(pending), str(parts), str(seed)]
    path = os.pathsep.join(filter(None, (str(folder), os.environ.get("PYTHONPATH"))))
    said = subprocess.run(asked, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=True)
    return Speed(**json.loads(said.stdout))


def main(name: str, pending: str, parts: str, seed: str) -> None:
    if scheduler.__file__.endswith(".py"):
        raise SystemExit(f"expected the compiled board, got {scheduler.__file__}")
    load = next(load for load in LOADS if load.name == name)
    print(json.dumps(asdict(measure(load, int(pending), int(parts), np.random.default_rng(int(seed))))))


if __name__ == "__main__":
    main(*sys.argv[1:])
