"""Files that only grow: all of what is written or nothing of it, by one process, read back as it was."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
import rerun.blueprint as rrb
from hypothesis import given, settings
from hypothesis import strategies as st

from logs import disk
from logs.disk import Appended, CannotWriteError
from logs.mjpeg_file import MjpegFile, Pictures
from logs.recording.stream import RecordingStream
from logs.run_errors import RecordingError

DRAWING = """
import random, sys
import rerun as rr, rerun.blueprint as rrb
from logs.recording.stream import RecordingStream
from logs.run_errors import RecordingError
stream = RecordingStream(sys.argv[1], "run", "run", rrb.Blueprint())
for cycle in range(2000):
    stream.at(cycle, 0.1 * cycle)
    stream.log("text", rr.TextLog, text=[random.Random(cycle).randbytes(150).hex()])
    stream.end_cycle()
try:
    stream.close()
except RecordingError:
    print("not written")
"""


@given(st.lists(st.binary(max_size=40), max_size=8), st.integers(0, 120))
@settings(max_examples=60, deadline=None)
def test_on_a_full_disk_a_piece_is_there_as_a_whole_or_not_at_all(pieces: list[bytes], room: int) -> None:
    real = os.write

    def write(file: int, data: bytes) -> int:
        left = room - os.fstat(file).st_size
        if left <= 0 < len(data):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return real(file, data[:left])

    with TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patched:
        patched.setattr(disk.os, "write", write)
        path, kept = Path(folder) / "file", b""
        file = Appended(path, "journal")
        for piece in pieces:
            try:
                file.append(piece)
                kept += piece
            except CannotWriteError as error:
                assert error.errno == errno.ENOSPC and error.filename == str(path)
                assert len(kept) + len(piece) > room
        file.close()
        assert path.read_bytes() == kept


def test_what_is_not_whole_is_dropped_before_it_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"whole|torn")
    file = Appended(path, "journal", keep=6)
    file.append(b"new")
    file.sync()
    file.close()
    assert path.read_bytes() == b"whole|new"


def test_one_process_writes_at_a_time(tmp_path: Path) -> None:
    first = Appended(tmp_path / "file", "journal")
    first.append(b"first")
    with pytest.raises(CannotWriteError, match="another process is writing it"):
        Appended(tmp_path / "file", "journal")
    assert (tmp_path / "file").read_bytes() == b"first"
    first.close()
    Appended(tmp_path / "file", "journal").close()


def test_nothing_is_written_through_a_link_or_into_a_pipe(tmp_path: Path) -> None:
    (tmp_path / "mine").write_bytes(b"mine")
    for name in ("file", "whole.json.part", "whole.json", "recording.rrd"):
        (tmp_path / name).symlink_to(tmp_path / "mine")
    os.mkfifo(tmp_path / "pipe")
    for name in ("file", "pipe"):
        with pytest.raises(OSError):
            Appended(tmp_path / name, "journal")
    disk.write_whole(tmp_path / "whole.json", "{}")
    with pytest.raises(RecordingError, match="cannot be written"):
        RecordingStream(tmp_path / "recording.rrd", "run", "run", rrb.Blueprint())
    assert (tmp_path / "mine").read_bytes() == b"mine" and (tmp_path / "whole.json").read_text() == "{}"


@pytest.mark.parametrize("held", range(3))
def test_a_drawing_on_a_full_disk_holds_nobody(tmp_path: Path, held: int) -> None:
    """In a process of its own, as the library may hold that at its exit too."""
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "none", tmp_path], capture_output=True).returncode:
        pytest.skip("nothing can be mounted here")
    try:
        (tmp_path / "filler").write_bytes(bytes(600_000 + 35_000 * held))
        done = subprocess.run([sys.executable, "-c", DRAWING, tmp_path / "r.rrd"], capture_output=True, text=True,
                              timeout=60)
        assert (done.returncode, done.stdout) == (0, "not written\n")
    finally:
        subprocess.run(["umount", "-l", tmp_path], check=True)


@given(st.lists(st.binary(min_size=1, max_size=30), max_size=6), st.integers(0, 3))
@settings(max_examples=40, deadline=None)
def test_pictures_come_back_by_their_numbers(jpegs: list[bytes], first: int) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "camera.mjpeg"
        file = MjpegFile(path)
        for jpeg in jpegs:
            file.add(jpeg)
        file.close()
        numbered = {first + 2 * n: jpeg for n, jpeg in enumerate(jpegs)}
        pictures = Pictures(path, ((number, len(jpeg)) for number, jpeg in numbered.items()))
        assert dict(pictures) == numbered
        assert pictures.end == path.stat().st_size
        assert pictures.get(1000) is None
