"""Writes signatures.json: what missions have compiled, a lost robot's too. ``python -m docs.tools.signatures``."""

from __future__ import annotations

import json
import sys
import tempfile

import harvey
from docs.tools.compiling import FILE, list_compiled

ROOMS = ("world_models.", "knowledge_sources.", "sim.")
MISSIONS = "lab-to-allens-office", "hallway-kidnap"
"""Figure 17's, and one on which the robot is lost: some functions only a lost robot calls."""


def main() -> None:
    for mission in MISSIONS:
        with tempfile.TemporaryDirectory() as folder:
            harvey.run(mission, seed=0, out=folder)
    found = list_compiled(sorted(name for name in sys.modules if name.startswith(ROOMS)))
    FILE.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    print(f"{FILE.name}: {sum(map(len, found.values()))} functions of {len(found)} files")


if __name__ == "__main__":
    main()
