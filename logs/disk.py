"""Appending to a file so that whatever happens leaves it whole: all of what is written, or nothing of it."""

from __future__ import annotations

import errno
import fcntl
import os
import stat
from pathlib import Path

from world_models.files.regular_files import open_regular

MOST_JOURNAL_BYTES = 4_000_000_000
"""Of a journal that is read."""


class CannotWriteError(OSError):
    """A file of a run cannot be written any more, as when the disk is full; what was written before stays valid."""


class Appended:
    """A file that only grows.

    After :meth:`append` the bytes are with the operating system, so that they outlive the process even if it is killed;
    after :meth:`sync` they are on the disk, so that they outlive a power cut too.
    """

    def __init__(self, path: Path, what: str, *, keep: int | None = 0) -> None:
        """Begin a file, or go on with one behind its first ``keep`` bytes; what it holds beyond them is dropped.

        ``what`` names the file in messages; to keep None keeps all. Raises OSError where it cannot be opened, is a link
        or a pipe, or somebody writes it.
        """
        self._path, self._what = path, what
        self._file = no_follow(path, os.O_WRONLY | os.O_CREAT)
        self._size = 0
        if stat.S_ISREG(os.fstat(self._file).st_mode):
            self._lock()
            if keep is not None:
                os.ftruncate(self._file, keep)
            self._size = os.lseek(self._file, 0, os.SEEK_END)

    def append(self, data: bytes) -> None:
        """Add bytes at the end, all or none. Raises CannotWriteError."""
        try:
            done = 0
            while done < len(data):
                done += os.write(self._file, data[done:])
        except OSError as error:
            self._undo()
            raise self._cannot(error) from error
        self._size += len(data)

    def sync(self) -> None:
        """Force everything onto the disk. Raises CannotWriteError."""
        try:
            os.fsync(self._file)
        except OSError as error:
            raise self._cannot(error) from error

    def close(self) -> None:
        """No more bytes."""
        os.close(self._file)

    def _lock(self) -> None:
        """Nobody else may write it meanwhile; the lock goes with the process, however that ends."""
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.fstat(self._file).st_ino == os.lstat(self._path).st_ino:  # else it was deleted meanwhile
                return
        except (BlockingIOError, FileNotFoundError):
            pass
        os.close(self._file)
        message = f"cannot write the {self._what}: another process is writing it"
        raise CannotWriteError(errno.EAGAIN, message, str(self._path))

    def _undo(self) -> None:
        """Take back what was written of the last bytes; a file that cannot be cut is left for the reader to mend."""
        try:
            os.ftruncate(self._file, self._size)
            os.lseek(self._file, self._size, os.SEEK_SET)
        except OSError:
            return

    def _cannot(self, error: OSError) -> CannotWriteError:
        return CannotWriteError(error.errno, f"cannot write the {self._what}: {error.strerror}", str(self._path))


def is_being_written(path: Path) -> bool:
    """Whether a process, this one included, has the file as :class:`Appended` now. Raises OSError."""
    try:
        with open_regular(path, MOST_JOURNAL_BYTES) as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except BlockingIOError:
        return True
    return False


def no_follow(path: Path | str, flags: int) -> int:
    """Opens a file that is not somebody else's: no link leads to it, and nobody waits for a pipe. Raises OSError."""
    return os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, 0o666)


def write_whole(path: Path, text: str, *, sync: bool = False) -> None:
    """Write a file, if asked onto the disk; an older one stays until the new one is whole. Raises OSError."""
    part = path.with_name(f"{path.name}.part")
    try:
        part.unlink(missing_ok=True)
        with open(part, "x", encoding="utf-8") as out:
            out.write(text)
            if sync:
                out.flush()
                os.fsync(out.fileno())
        os.replace(part, path)
    except OSError:
        part.unlink(missing_ok=True)
        raise


def sync_folder(path: Path) -> None:
    """Force the names of a folder's files onto the disk, where the file system can do that."""
    folder = os.open(path, os.O_RDONLY)
    try:
        os.fsync(folder)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise
    finally:
        os.close(folder)
