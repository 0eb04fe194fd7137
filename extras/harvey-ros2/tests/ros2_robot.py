"""An emulated robot in a process of its own, as ``harvey emulate ros2`` has it, and a mission for it."""

from __future__ import annotations

import re
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

GOAL_M = 9 * 0.3048
MISSION = """
world = "research_center"
goal = "(ptrans (hallway (4,4,0)) (hallway (9,4,0)))"
[start]
put_down_sigma_in = 0.5
[base]
port = "ros2:{robot}"
[camera]
source = "ros2:{robot}"
calibration = "camera.toml"
late_s = 5.0
rate_hz = 0.5
"""
PLACE = re.compile(r"= (-?[\d.]+) (-?[\d.]+) m in")


@dataclass
class Emulated:
    """A robot: its process, where it is met, and where it truly is [m], as its trace tells."""

    process: subprocess.Popen[str]
    address: str
    mission: Path
    places: list[tuple[float, float]] = field(default_factory=list)

    def follow(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if (found := PLACE.search(line)) is not None:
                self.places.append((float(found[1]), float(found[2])))


@contextmanager
def emulated(folder: Path, *options: str, scenario: str = "forty-foot-hallway") -> Iterator[Emulated]:
    """A robot where a scenario begins, and ``mission.toml`` and ``robot.toml`` in a folder."""
    command = [sys.executable, "-m", "harvey.cli", "emulate", "ros2", "--scenario", scenario, "--trace",
               "--calibration", str(folder / "camera.toml"), *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, bufsize=1) as process:
        assert process.stdout is not None
        first = process.stdout.readline()
        found = re.search(r"tcp/\S+(?=;)", first)
        assert found is not None, first
        (folder / "robot.toml").write_text(f'router = "{found[0]}"\n[topics]\nhazards = "hazards"\n')
        (folder / "mission.toml").write_text(MISSION.format(robot=folder / "robot.toml"))
        robot = Emulated(process, found[0], folder / "mission.toml")
        follower = threading.Thread(target=robot.follow, daemon=True)
        follower.start()
        try:
            yield robot
        finally:
            process.kill()
            follower.join(5.0)
