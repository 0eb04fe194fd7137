"""``harvey drive`` as a user has it: an emulated base on a pseudo-terminal, a camera on the network, real time."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from harvey.cli import main
from sim.faults.built_in_faults import CameraUnplugged, LinkLost
from tests.emulated_robot import GOAL_M, INCH_M, emulated


def result_of(folder: Path) -> dict[str, object]:
    found: dict[str, object] = json.loads((folder / "run" / "result.json").read_text())
    return found


@pytest.mark.slow
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
    assert "the place where it believes to be, because" in told
    result = result_of(tmp_path)
    assert result["outcome"] == "reached"
    assert result["final_error_m"] is None and result["collisions"] is None
    assert main(["replay", str(tmp_path / "run")]) == 0
    assert main(["why", str(tmp_path / "run")]) == 0


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


@pytest.mark.slow
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
