"""Watching and recording at once: a viewer's stand-in reads the live stream, comes late, or dies on the way."""

from __future__ import annotations

import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from journals import read_decisions
from logs.reader import read_frames
from logs.recording.writer import RecordingWriter
from logs.run_errors import RecordingError
from scripted_mission import CAMERA, MOUNT, house, play

PATIENCE_S = 300.0


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def recording_writer(path: Path | None, port: int) -> RecordingWriter:
    return RecordingWriter(path, world=house(), camera=CAMERA, mount=MOUNT, title="house", recording_id="house",
                           live=True, live_port=port)


@contextmanager
def watching(port: int, into: Path) -> Iterator[subprocess.Popen[bytes]]:
    """A program that connects as a viewer does, and keeps what it is sent."""
    program = shutil.which("rerun", path=str(Path(sys.executable).parent))
    if program is None:
        pytest.skip("rerun's command line is not installed beside this Python")
    watcher = subprocess.Popen([program, "--port", str(free_port()), "--save", str(into), f"rerun+http://127.0.0.1:{port}/proxy"],
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield watcher
    finally:
        watcher.kill()
        watcher.wait()


def arrived(path: Path) -> int:
    """How many decisions a file holds that is still being written."""
    try:
        return len(read_decisions(path))
    except RecordingError:
        return 0


def until(holds: Callable[[], bool]) -> bool:
    """Whether it comes to hold: the watcher is another process, and takes its time."""
    end_s = time.monotonic() + PATIENCE_S
    while not holds() and time.monotonic() < end_s:
        time.sleep(0.1)
    return holds()


def test_file_and_watcher_get_everything(tmp_path: Path) -> None:
    port = free_port()
    recorder = recording_writer(tmp_path / "kept.rrd", port)
    cycles = play([recorder]).cycle
    recorder.flush()
    with watching(port, tmp_path / "seen.rrd"):  # a late viewer gets what was before
        assert until(lambda: arrived(tmp_path / "seen.rrd") == cycles)
    recorder.close()
    assert read_decisions(tmp_path / "seen.rrd") == read_decisions(tmp_path / "kept.rrd")
    assert read_frames(tmp_path / "seen.rrd") == read_frames(tmp_path / "kept.rrd")


def test_a_watcher_that_dies_stops_nothing(tmp_path: Path) -> None:
    port = free_port()
    recorder = recording_writer(tmp_path / "kept.rrd", port)
    with watching(port, tmp_path / "seen.rrd") as watcher:
        def die_at_the_fifth_line(number: int) -> None:
            if number == 5:
                assert until(lambda: (tmp_path / "seen.rrd").exists())
                watcher.kill()

        cycles = play([recorder], die_at_the_fifth_line).cycle
    recorder.close()
    assert len(read_decisions(tmp_path / "kept.rrd")) == cycles


def test_nobody_watching_stops_nothing(tmp_path: Path) -> None:
    recorder = recording_writer(tmp_path / "kept.rrd", free_port())
    cycles = play([recorder]).cycle
    recorder.close()
    assert len(read_decisions(tmp_path / "kept.rrd")) == cycles


def test_a_port_that_is_taken_is_told() -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        with pytest.raises(RecordingError, match=r"live recording: 127\.0\.0\.1:\d+ cannot be served"):
            recording_writer(None, other.getsockname()[1])
