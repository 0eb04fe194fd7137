"""Files that others give are read only where they are regular ones, and no larger than they may be."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from stat import S_ISREG
from typing import BinaryIO

MOST_BYTES = 200_000_000
IRREGULAR = "no regular file, but a device, a pipe or a folder"


def expect_regular(path: Path) -> None:
    """Raises OSError where it is a device, a pipe or a folder, or not there."""
    if not S_ISREG(os.stat(path).st_mode):
        raise OSError(errno.EINVAL, IRREGULAR, str(path))


def open_regular(path: Path, most_bytes: int = MOST_BYTES) -> BinaryIO:
    """A file to read. Raises OSError where it cannot be read, is larger, or is a device, a pipe or a folder."""
    if "\0" in str(path):
        raise OSError(errno.EINVAL, "a name with a NUL in it", str(path))
    expect_regular(path)  # first: to open a device may do something to it
    file = open(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb")  # noqa: SIM115 (who calls closes it)
    found = os.fstat(file.fileno())
    if S_ISREG(found.st_mode) and found.st_size <= most_bytes:
        return file
    file.close()
    if S_ISREG(found.st_mode):
        raise OSError(errno.EFBIG, f"more than {most_bytes} bytes", str(path))
    raise OSError(errno.EINVAL, IRREGULAR, str(path))


def read_regular(path: Path, most_bytes: int = MOST_BYTES) -> bytes:
    """The bytes of a file. Raises OSError as :func:`open_regular`."""
    with open_regular(path, most_bytes) as file:
        return file.read() or b""
