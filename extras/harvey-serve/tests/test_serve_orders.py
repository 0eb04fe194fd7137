"""A driving robot is paused, sent elsewhere and resumed from its live page."""

from __future__ import annotations

import re
import subprocess
import sys
import urllib.request
from pathlib import Path

from tests.emulated_robot import INCH_M, emulated


def test_from_its_page_a_robot_is_sent_elsewhere_paused_and_resumed(tmp_path: Path) -> None:
    with emulated(tmp_path) as robot:
        driving = subprocess.Popen([sys.executable, "-m", "harvey.cli", "drive", *robot.options, "--serve", "0"],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        try:
            assert driving.stdout is not None
            address = next(found for line in driving.stdout if (found := re.search(r"(http://\S+/)#(\S+)", line)))

            def order(path: str, words: bytes = b"") -> str:
                asked = urllib.request.Request(
                    address[1] + path, words, {"Authorization": f"Bearer {address[2]}"}, method="POST")
                with urllib.request.urlopen(asked) as answer:
                    return str(answer.read().decode())

            assert order("orders/pause") == "paused\n"
            with urllib.request.urlopen(f"{address[1]}events") as events:
                assert any(b'"state":"paused"' in line for line in events)
            assert order("goal", b"(hallway (7,4,0))") == "told: (hallway (7,4,0))\n"
            assert order("orders/resume") == "running\n"
            driving.communicate()
        finally:
            driving.kill()
            driving.wait()
        assert driving.returncode == 0
        there = robot.body.truth
    assert abs(there.world_from_robot.x_m - 7 * 0.3048) < INCH_M and there.collisions == 0
