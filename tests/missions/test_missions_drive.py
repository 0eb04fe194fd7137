"""``harvey drive`` as a user has it: an emulated base on a pseudo-terminal, a camera on the network, real time."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from harvey.cli import main
from sim.body.simulated_body import SimulatedBody
from sim.emulators.camera_server import CameraServer
from sim.emulators.denning import ConstantSpeedMotion, DenningEmulator
from sim.emulators.emulator import SimulatedGround
from sim.emulators.line import FaultyLine, PseudoTerminal
from sim.faults.fault import Fault
from sim.faults.kinds import CameraUnplugged, LinkLost
from sim.scenario import Scenario, load_scenario
from sim.stage import build_stage
from world_models.files.toml.camera_file import camera_text

GOAL = "(ptrans (hallway (4,4,0)) (hallway (9,4,0)))"
GOAL_M, INCH_M = 9 * 0.3048, 0.0254
MISSION = f"""
world = "research_center"
goal = "{GOAL}"
[start]
put_down_sigma_in = 0.5
[camera]
calibration = "camera.toml"
lag_s = 0.2
late_s = 5.0
rate_hz = 0.5
"""


@dataclass
class Emulated:
    """What a user is told of an emulated robot, and its truth."""

    body: SimulatedBody
    base: DenningEmulator
    options: list[str]


def scenario() -> Scenario:
    return replace(load_scenario("forty-foot-hallway"), goal=GOAL)


@contextmanager
def emulated(folder: Path, *faults: Fault) -> Iterator[Emulated]:
    """A robot in the hallway, as ``harvey emulate`` has it, in threads of this process."""
    stage = build_stage(replace(scenario(), faults=faults))
    body, over = stage.body(0), threading.Event()
    body.picture()  # compiled before anybody waits for it
    base = DenningEmulator(ConstantSpeedMotion(SimulatedGround(body)), watchdog_s=2.0)
    terminal = PseudoTerminal(FaultyLine(base, body))
    server = threading.Thread(target=terminal.serve, kwargs={"until": over.is_set, "speed": 1.5})
    (folder / "camera.toml").write_text(camera_text(stage.scenario.camera.camera, stage.scenario.camera.mount))
    (folder / "mission.toml").write_text(MISSION)
    with CameraServer(body, rate_hz=6.0) as camera:
        server.start()
        try:
            yield Emulated(body, base, [str(folder / "mission.toml"), "--base", f"denning:{terminal.name}",
                                        "--camera", camera.url, "--out", str(folder / "run")])
        finally:
            over.set()
            server.join()
    terminal.close()


def result_of(folder: Path) -> dict[str, object]:
    found: dict[str, object] = json.loads((folder / "run" / "result.json").read_text())
    return found


def test_dry_run_then_a_mission_in_which_line_and_camera_fail_and_come_back(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    faults = LinkLost(after_m=0.7, duration_s=4.0), CameraUnplugged(after_m=1.0, duration_s=4.0)
    with emulated(tmp_path, *faults) as robot:
        assert main(["drive", *robot.options, "--dry-run"]) == 0
        told = capsys.readouterr().out
        assert "FAILED" not in told and "nothing was moved" in told
        assert robot.body.truth.path_m == 0.0 and not (tmp_path / "run").exists()
        assert main(["drive", *robot.options]) == 0
        there = robot.body.truth
    assert abs(there.world_from_robot.x_m - GOAL_M) < INCH_M and there.collisions == 0
    told = capsys.readouterr().err
    assert "base: link lost: over" in told and "camera: camera unplugged: over" in told
    assert "check of the belief, because" in told
    result = result_of(tmp_path)
    assert result["outcome"] == "reached"
    assert result["final_error_m"] is None and result["collisions"] is None
    assert main(["replay", str(tmp_path / "run")]) == 0
    assert main(["why", str(tmp_path / "run")]) == 0


def test_from_its_page_a_robot_is_sent_elsewhere_paused_and_resumed(tmp_path: Path) -> None:
    pytest.importorskip("uvicorn", reason="the extra 'serve' is not installed")
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
            assert order("goal", b"(hallway (7,4,0))") == "asked to go: (hallway (7,4,0))\n"
            assert order("orders/resume") == "running\n"
            driving.communicate()
        finally:
            driving.kill()
            driving.wait()
        assert driving.returncode == 0
        there = robot.body.truth
    assert abs(there.world_from_robot.x_m - 7 * 0.3048) < INCH_M and there.collisions == 0


def test_whoever_wants_it_to_stop_is_heeded_at_once(tmp_path: Path) -> None:
    with emulated(tmp_path) as robot:
        stop = _when(lambda: robot.body.truth.path_m > 0.3, lambda: os.kill(os.getpid(), signal.SIGTERM))
        assert main(["drive", *robot.options]) == 1
        stop.join()
        assert not robot.base.moving
    assert robot.body.truth.path_m < 1.2
    result = result_of(tmp_path)
    assert (result["outcome"], result["reason"]) == ("stopped", "stopped by SIGTERM")
    assert main(["why", str(tmp_path / "run")]) == 0


def test_a_mission_whose_process_was_killed_in_mid_move_goes_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with emulated(tmp_path) as robot:
        process = subprocess.Popen([sys.executable, "-m", "harvey.cli", "drive", *robot.options],
                                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, stdin=subprocess.DEVNULL)
        kill = _when(lambda: robot.body.truth.path_m > 0.75 and robot.base.moving, process.kill)
        process.wait()
        kill.join()
        time.sleep(3.0)
        assert not robot.base.moving  # its watchdog
        gone_m, run = robot.body.truth.path_m, str(tmp_path / "run")
        assert result_of(tmp_path)["outcome"] == "unfinished"
        assert main(["resume", run]) == 0
        there = robot.body.truth
    assert gone_m < 1.5 and abs(there.world_from_robot.x_m - GOAL_M) < INCH_M and there.collisions == 0
    told = capsys.readouterr().err
    assert "replayed, then it goes on" in told and "base: link lost: over" in told
    assert result_of(tmp_path)["outcome"] == "reached"
    assert main(["replay", run]) == 0
    assert main(["why", run, "resumed-1"]) == 0
    assert main(["resume", run]) == 0 and "was not cut off" in capsys.readouterr().out


def _when(holds: Callable[[], bool], then: Callable[[], None]) -> threading.Thread:
    def wait() -> None:
        while not holds():
            time.sleep(0.005)
        then()

    thread = threading.Thread(target=wait, daemon=True)
    thread.start()
    return thread
