"""The camera's pictures on disk: the JPEGs one behind the other, as the camera delivered them.

The file is ``camera.mjpeg``; video tools play it (``ffplay camera.mjpeg``). It needs no index: the journal tells the
length and the SHA-256 of every picture, in the order in which they stand in the file. A picture is written before any
knowledge source sees it, so that no decision rests on something that a crash, or with ``sync`` a power cut, could take
away.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from logs.disk import Appended
from world_models.files.regular_files import MOST_BYTES, open_regular


class MjpegFile:
    """Writes ``camera.mjpeg``."""

    def __init__(self, path: Path, *, keep: int = 0, sync: bool = True) -> None:
        """Begin a file, or go on with one behind its first ``keep`` bytes.

        ``sync`` forces each picture onto the disk. Raises OSError.
        """
        self._sync = sync
        self._file = Appended(path, "camera's pictures", keep=keep)

    def add(self, jpeg: bytes) -> None:
        """Write a picture. Raises CannotWriteError."""
        self._file.append(jpeg)
        if self._sync:
            self._file.sync()

    def close(self) -> None:
        """No more pictures."""
        self._file.close()


class Pictures(Mapping[int, bytes]):
    """The pictures of a run by number; each is read from the file when it is asked for.

    Attributes:
        path: of the file.
        end: length that the file has to have [bytes].
    """

    def __init__(self, path: Path, sizes: Iterable[tuple[int, int]]) -> None:
        """``sizes``: (number, length in bytes) of each picture in the order of the file."""
        self.path = path
        self._places: dict[int, tuple[int, int]] = {}
        end = 0
        for number, size in sizes:
            self._places[number] = end, size
            end += size
        self.end = end

    def where(self, number: int) -> str:
        """In which file a picture is, and where in it. Raises KeyError."""
        start, size = self._places[number]
        return f"{self.path}, bytes {start} to {start + size}"

    def __getitem__(self, number: int) -> bytes:
        """The picture's bytes, fewer where the file is too short. Raises KeyError, OSError."""
        start, size = self._places[number]
        with open_regular(self.path, self.end + MOST_BYTES) as file:
            file.seek(start)
            return file.read(size)

    def __iter__(self) -> Iterator[int]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)
