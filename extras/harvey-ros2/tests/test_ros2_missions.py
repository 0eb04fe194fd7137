"""Missions over ROS 2: without a network the same bytes each time; over Zenoh with a robot in another process."""

from __future__ import annotations

import json
import math
import os
import signal
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from dataclasses import replace
from pathlib import Path

import pytest
from ros2_network import Network, relayed, spaced
from ros2_robot import GOAL_M, Emulated, emulated

from harvey.cli import main
from harvey.simulation.simulated_run import run_mission
from harvey_ros2.emulated.robot_emulator import WATCHDOG_S
from harvey_ros2.robot.robot_file import DriveSettings, RobotFile, read_robot
from sim.scenario import SCENARIOS, load_scenario
from sim.stage import build_stage

ROOT = Path(__file__).parents[3]
INCH_M = 0.0254


def test_a_mission_through_messages_is_the_same_each_time_and_its_replay_too(tmp_path: Path) -> None:
    short = replace(load_scenario("forty-foot-hallway"), goal="(ptrans (hallway (4,4,0)) (hallway (9,4,0)))")
    journals = []
    for name in ("one", "two"):
        result = run_mission(build_stage(short), 0,
                             out=tmp_path / name, body="ros2")
        assert result.outcome == "reached" and result.final_error_m is not None and result.final_error_m < INCH_M
        journals.append((tmp_path / name / "journal.jsonl").read_bytes())
    assert journals[0] == journals[1]
    assert main(["replay", str(tmp_path / "one")]) == 0


ZENOH, DDS = 'router = "{address}"', 'middleware = "cyclonedds"\ndomain = 79'


@pytest.mark.parametrize("middleware", [ZENOH, DDS])
def test_a_mission_in_which_the_robots_process_stands_still_for_a_while(
    middleware: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if middleware is DDS:
        pytest.importorskip("cyclonedds")
    with emulated(tmp_path, middleware=middleware) as robot:
        assert main(["drive", str(robot.mission), "--dry-run"]) == 0
        assert "FAILED" not in capsys.readouterr().out and not (tmp_path / "run").exists()

        def hold() -> None:
            while not any(x > 4 * 0.3048 + 0.6 for x, _ in robot.places):
                time.sleep(0.01)
            os.kill(robot.process.pid, signal.SIGSTOP)
            time.sleep(2.5)
            os.kill(robot.process.pid, signal.SIGCONT)

        holding = threading.Thread(target=hold, daemon=True)
        holding.start()
        assert main(["drive", str(robot.mission), "--out", str(tmp_path / "run")]) == 0
        holding.join(1.0)
        time.sleep(1.5)  # its place is told once a second
        x, y = robot.places[-1]
    assert abs(x - GOAL_M) < INCH_M and abs(y - 4 * 0.3048) < INCH_M
    told = capsys.readouterr().err
    assert "base: link lost (no odometry for 0.4 s" in told and "base: link lost: over" in told
    result = json.loads((tmp_path / "run" / "result.json").read_text())
    assert result["outcome"] == "reached"
    assert main(["replay", str(tmp_path / "run")]) == 0


@pytest.mark.parametrize("way", [relayed, spaced])
def test_where_the_network_is_cut_the_robot_stands_within_its_watchdogs_time_and_goes_on_when_it_is_mended(
    way: Callable[[], AbstractContextManager[Network | None]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with way() as network:
        if network is None:
            pytest.skip("expected the right to make a network namespace")
        with emulated(tmp_path, at=network.robot, before=network.before) as robot:
            told = tmp_path / "robot.toml"
            told.write_text(told.read_text().replace(network.robot, network.us))
            seen: dict[str, tuple[float, float]] = {}

            def cut() -> None:
                seen["cut"] = wait_for_place(robot, 4 * 0.3048 + 0.6)
                network.cut()
                time.sleep(2.0)
                seen["stood"] = robot.places[-1]
                time.sleep(2.0)
                seen["stands"] = robot.places[-1]
                network.mend()

            cutting = threading.Thread(target=cut, daemon=True)
            cutting.start()
            assert main(["drive", str(robot.mission), "--out", str(tmp_path / "run")]) == 0
            cutting.join(1.0)
            time.sleep(1.5)
            x, y = robot.places[-1]
    assert seen["stood"] == seen["stands"]
    assert math.dist(seen["cut"], seen["stood"]) < 0.3 * (WATCHDOG_S + 0.2)
    assert abs(x - GOAL_M) < INCH_M and abs(y - 4 * 0.3048) < INCH_M
    err = capsys.readouterr().err
    assert "base: link lost" in err and "base: link lost: over" in err
    assert main(["replay", str(tmp_path / "run")]) == 0


@pytest.mark.parametrize("middleware", [ZENOH, DDS])
def test_a_robots_process_that_is_killed_and_begins_again_where_it_stood_goes_on_when_it_is_told_to(
    middleware: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if middleware is DDS:
        pytest.importorskip("cyclonedds")
    with ExitStack() as stack:
        first = stack.enter_context(emulated(tmp_path, middleware=middleware))
        second: list[Emulated] = []

        def restart() -> None:
            x, y = wait_for_place(first, 4 * 0.3048 + 0.6)
            first.process.kill()
            there = f"(hallway ({x / 0.3048:.5f},{y / 0.3048:.5f},0))"
            scenario = (SCENARIOS / "forty-foot-hallway.toml").read_text().replace("(hallway (4,4,0))", there)
            (tmp_path / "again.toml").write_text(scenario.replace("put_down_sigma_in = 0.1", "put_down_sigma_in = 0.0"))
            second.append(stack.enter_context(
                emulated(tmp_path, middleware=middleware, at=first.address, scenario=str(tmp_path / "again.toml"))))

        restarting = threading.Thread(target=restart, daemon=True)
        restarting.start()
        code = main(["drive", str(first.mission), "--out", str(tmp_path / "run")])
        restarting.join(1.0)
        time.sleep(1.5)
        x, y = second[0].places[-1]
    err = capsys.readouterr().err
    assert "base: link lost" in err and "base: link lost: over" in err
    result = json.loads((tmp_path / "run" / "result.json").read_text())
    assert code == 0 and result["outcome"] == "reached" and result["relocalizations"] == 0
    assert abs(x - GOAL_M) < INCH_M and abs(y - 4 * 0.3048) < INCH_M
    assert main(["replay", str(tmp_path / "run")]) == 0


def wait_for_place(robot: Emulated, x_m: float) -> tuple[float, float]:
    """The first place that it tells beyond so far along the hallway."""
    while True:
        for x, y in robot.places[-1:]:
            if x > x_m:
                return x, y
        time.sleep(0.002)


def test_the_documented_robots_file_is_read_and_has_every_default() -> None:
    text = (ROOT / "docs/flat/robot.toml").read_text(encoding="utf-8")
    assert f"```toml\n{text}```" in (ROOT / "docs/how-to/ros2.md").read_text(encoding="utf-8")
    read = read_robot(str(ROOT / "docs/flat/robot.toml"))
    assert replace(read, topics=replace(read.topics, hazards=""), drive=replace(
        read.drive, turn_rad_per_s=DriveSettings().turn_rad_per_s)) == RobotFile()


def test_what_is_wrong_with_a_robots_file_or_its_network_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "robot.toml").write_text('router = "tcp/127.0.0.1:1"\n')
    (tmp_path / "wrong.toml").write_text('[drive]\nfresh_s = 0.0\n')
    (tmp_path / "odd.toml").write_text('[topics]\nodom = "a b"\n')
    mission = tmp_path / "mission.toml"
    mission.write_text('world = "research_center"\ngoal = "Go from the hallway to the library"\n')
    for where, said in (
        (tmp_path / "robot.toml", "expected a Zenoh router at tcp/127.0.0.1:1"),
        (tmp_path / "wrong.toml", "wrong.toml:2: drive.fresh_s: expected a number from 0.05 to 5, got 0.0"),
        (tmp_path / "odd.toml", "expected odom = the name of a topic, as camera/image_raw, got 'a b'"),
        (tmp_path / "none.toml", "none.toml: expected a readable file, got: No such file or directory"),
    ):
        assert main(["drive", str(mission), "--dry-run", "--base", f"ros2:{where}", "--camera", f"ros2:{where}"]) == 2
        lines = [line for line in capsys.readouterr().out.splitlines()
                 if line.startswith(("FAILED  base", "FAILED  cam"))]
        assert len(lines) == 2 and all(said in line for line in lines), (lines, said)
    (tmp_path / "loud.toml").write_text('middleware = "smoke signals"\n')
    for where, said in (
        (tmp_path / "none.toml", "expected a readable file"), ("tcp/nowhere", "a router can listen"),
        (tmp_path / "loud.toml", "expected middleware = zenoh or cyclonedds"),
    ):
        assert main(["emulate", "ros2", "--at", str(where)]) == 2
        assert said in capsys.readouterr().err
