"""Files that others give are read only where they are regular ones, and no larger than they may be."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from stat import S_ISREG

MOST_BYTES = 200_000_000
IRREGULAR = "no regular file, but a device, a pipe or a folder"


def expect_regular(path: Path) -> None:
    """Raises OSError where it is a device, a pipe or a folder, or not there."""
    if not S_ISREG(os.stat(path).st_mode):
        raise OSError(errno.EINVAL, IRREGULAR, str(path))


def read_regular(path: Path, most_bytes: int = MOST_BYTES) -> bytes:
    """The bytes of a file. Raises OSError where it cannot be read, is larger, or is a device, a pipe or a folder."""
    if "\0" in str(path):
        raise OSError(errno.EINVAL, "a name with a NUL in it", str(path))
    expect_regular(path)  # first: to open a device may do something to it
    with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb") as file:
        if not S_ISREG(os.fstat(file.fileno()).st_mode):
            raise OSError(errno.EINVAL, IRREGULAR, str(path))
        data = file.read(most_bytes + 1) or b""
    if len(data) > most_bytes:
        raise OSError(errno.EFBIG, f"more than {most_bytes} bytes", str(path))
    return data
