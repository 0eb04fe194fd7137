"""``harvey serve`` over a real line: watchers cost the run no decision, and a stop leaves a whole run."""

from __future__ import annotations

import json
import re
import socket
import subprocess
import sys
import threading
import urllib.request
from contextlib import suppress
from pathlib import Path

import pytest

from harvey.campaign.mission_task import Task
from harvey.cli import main
from harvey.simulation.simulated_run import build_head, run_mission
from harvey_serve.app import build_app
from harvey_serve.follow import Follower
from harvey_serve.live_state import LiveState
from harvey_serve.run_gate import Gate, GatedBody
from harvey_serve.server import bind, serving
from logs.run_directory import RunDirectory

SHORT = (("limits.max_time_s", "6"),)
HOSTILE = (b"\x00\xff" * 4000, b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * 20_000, b"POST /orders/stop HTTP/1.1\r\n\r\n",
           b"GET / HTTP/9.9\r\nHost: 127.0.0.1\r\n\r\n", b"POST /orders/stop HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n")


def say(port: int, words: bytes) -> socket.socket:
    """A line on which this was said and nothing is read."""
    line = socket.create_connection(("127.0.0.1", port))
    with suppress(OSError):  # it was hung up on
        line.sendall(words)
    return line


def test_watchers_change_no_decision_whatever_they_do(tmp_path: Path) -> None:
    task = Task("forty-foot-hallway", SHORT, 0)
    stage = task.stage()
    alone, watched = tmp_path / "alone", tmp_path / "watched"
    run_mission(stage, 0, out=alone)

    head = build_head(stage, 0)
    world = head.load_world()
    gate, live = Gate(), LiveState(world, head.model(world).lens)
    gate.order("pause")
    listening = bind("127.0.0.1", 0)
    port = listening.getsockname()[1]
    told: list[str] = []

    def watch() -> None:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/events") as events:
            for line in events:
                told.append(line.decode())

    with serving(build_app(live, gate, world, title="a run", token="t"), listening):
        readers = [threading.Thread(target=watch, daemon=True) for _ in range(2)]
        for reader in readers:
            reader.start()
        ask = b"GET /events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
        lines = [say(port, words) for words in (ask, ask, *HOSTILE)]  # nobody reads their answers
        say(port, ask).close()
        gate.order("resume")
        run_mission(stage, 0, out=watched, sinks=(live,), around=lambda body, _replayed: GatedBody(body, gate))
        live.end("over")
    for reader in readers:
        reader.join()
    for line in lines:
        line.close()
    assert (watched / "journal.jsonl").read_bytes() == (alone / "journal.jsonl").read_bytes()
    last = [json.loads(one.removeprefix("data: ")) for one in told if one.strip()][-1]
    assert last["state"] == "ended" and last["picture"] is not None and last["belief"] is not None
    with pytest.raises(OSError):
        socket.create_connection(("127.0.0.1", port))


def test_a_stop_ends_the_run_with_exit_code_1_and_whole_files(tmp_path: Path) -> None:
    out = tmp_path / "run"
    with subprocess.Popen(
        [sys.executable, "-m", "harvey.cli", "serve", "forty-foot-hallway", "--port", "0", "--paused",
         "--out", str(out)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:
        assert process.stdout is not None
        found = re.search(r"(http://127\.0\.0\.1:\d+/)#(\S+)", process.stdout.readline())
        assert found is not None
        asked = urllib.request.Request(
            f"{found[1]}orders/stop", method="POST", headers={"Authorization": f"Bearer {found[2]}"})
        with urllib.request.urlopen(asked) as answer:
            assert answer.read() == b"stopping\n"
        printed, errors = process.communicate()
    assert process.returncode == 1 and "Traceback" not in errors
    assert "stopped: stopped from the page" in printed
    assert json.loads((out / "result.json").read_text())["outcome"] == "stopped"
    assert main(["replay", str(out)]) == 0
    assert (out / "recording.rrd").stat().st_size > 0


def test_a_run_that_another_command_drives_is_shown_from_its_files(tmp_path: Path) -> None:
    """What the page shows is what the run's own page would have shown, decision by decision, torn lines included."""
    task = Task("forty-foot-hallway", SHORT, 0)
    stage = task.stage()
    head = build_head(stage, 0)
    world = head.load_world()
    own = LiveState(world, head.model(world).lens)
    run_mission(stage, 0, out=tmp_path / "whole", sinks=(own,), head=head)
    whole, growing = RunDirectory(tmp_path / "whole"), RunDirectory(tmp_path / "growing")
    growing.path.mkdir()
    (growing.path / "camera.mjpeg").write_bytes(whole.camera.read_bytes())
    followed = LiveState(world, head.model(world).lens)
    follower = Follower(growing, followed)
    follower.read_on()
    assert not followed.take()
    journal = whole.journal.read_bytes()
    for end in (len(journal) // 3, 2 * len(journal) // 3, len(journal)):
        growing.journal.write_bytes(journal[:end])
        follower.read_on()
    (growing.path / "result.json").write_bytes(whole.result.read_bytes())
    assert follower.follow(lambda _s: pytest.fail("it has ended")).startswith("failed: not there after ")
    own.end(followed.ended or "failed")
    assert own.take() and followed.take()
    shown, told = (json.loads(one.message("running")) for one in (own, followed))
    for one in (shown, told):
        one.pop("ended")
        for row in one["decisions"]:
            row["trigger"] = row["trigger"].partition(":")[0]
    assert told == shown and len(told["decisions"]) == 12 and told["picture"] is not None


def test_a_run_that_has_ended_is_not_followed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run_mission(Task("forty-foot-hallway", SHORT, 0).stage(), 0, out=tmp_path / "run")
    assert main(["serve", str(tmp_path / "run"), "--port", "0"]) == 2
    assert "expected a run that goes on, got one that has ended (failed: " in capsys.readouterr().err
    (tmp_path / "empty").mkdir()
    assert main(["serve", str(tmp_path / "empty"), "--port", "0"]) == 2
