"""A load of the agenda with the board compiled, measured in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from blackboard import scheduler
from experiments.scale.agenda_load import LOADS, Load, Speed, measure


def measure_compiled(folder: Path, load: Load, waiting: Sequence[int], parts: int, seed: int) -> list[Speed]:
    """As :func:`experiments.scale.agenda_load.measure`, with what :func:`harvey.compiled.compile_board` wrote."""
    asked = [sys.executable, "-P", "-m", __name__, load.name, str(parts), str(seed), *map(str, waiting)]
    path = os.pathsep.join(filter(None, (str(folder), os.environ.get("PYTHONPATH"))))
    said = subprocess.run(asked, env={**os.environ, "PYTHONPATH": path}, stdout=subprocess.PIPE, text=True, check=True)
    return [Speed(**speed) for speed in json.loads(said.stdout)]


def main(name: str, parts: str, seed: str, *waiting: str) -> None:
    if scheduler.__file__.endswith(".py"):
        raise SystemExit(f"expected the compiled board, got {scheduler.__file__}")
    load = next(load for load in LOADS if load.name == name)
    print(json.dumps([asdict(speed) for speed in measure(load, [int(w) for w in waiting], int(parts), int(seed))]))


if __name__ == "__main__":
    main(*sys.argv[1:])
