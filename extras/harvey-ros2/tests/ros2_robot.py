"""An emulated robot in a process of its own, as ``harvey emulate ros2`` has it, and a mission for it."""

from __future__ import annotations

import re
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
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


def free_address() -> str:
    """Where a Zenoh router of this computer may listen."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{free.getsockname()[1]}"


@contextmanager
def emulated(
    folder: Path, *, middleware: str = 'router = "{address}"', scenario: str = "forty-foot-hallway", at: str = "",
    before: Sequence[str] = (),
) -> Iterator[Emulated]:
    """A robot where a scenario begins, and ``mission.toml`` and ``robot.toml`` in a folder.

    Args:
        middleware: lines of ``robot.toml``, which the robot and who drives it read.
        at: the address of its router; else any free one.
        before: words before the command, as ``ip netns exec``.
    """
    address = at or free_address()
    (folder / "robot.toml").write_text(middleware.format(address=address) + '\n[topics]\nhazards = "hazards"\n')
    (folder / "mission.toml").write_text(MISSION.format(robot=folder / "robot.toml"))
    command = [*before, sys.executable, "-m", "harvey.cli", "emulate", "ros2", "--scenario", scenario, "--trace",
               "--calibration", str(folder / "camera.toml"), "--at", str(folder / "robot.toml")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, bufsize=1) as process:
        assert process.stdout is not None
        first = process.stdout.readline()
        assert "Ctrl-C ends it" in first, first
        robot = Emulated(process, address, folder / "mission.toml")
        follower = threading.Thread(target=robot.follow, daemon=True)
        follower.start()
        try:
            yield robot
        finally:
            process.kill()
            follower.join(5.0)
