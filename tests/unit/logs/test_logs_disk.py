"""Files that only grow: all of what is written or nothing of it, by one process, read back as it was."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from logs import disk
from logs.disk import Appended, CannotWriteError
from logs.mjpeg_file import MjpegFile, Pictures


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
