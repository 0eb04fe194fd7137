"""Files of ROS 1 and ROS 2 with messages in them: mcap, sqlite3, .bag; also without an index, or broken off.

What a file is says its first bytes, not its name. One that breaks off is read up to there.
"""

from __future__ import annotations

import bz2
import re
import struct
from collections.abc import Collection, Iterator
from heapq import merge
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, Protocol

import zstandard
from lz4.frame import LZ4FrameDecompressor
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, Message, Schema
from rosbags.interfaces import Connection, ConnectionExtRosbag2, MessageDefinition, MessageDefinitionFormat
from rosbags.rosbag1 import Reader as RosOneReader
from rosbags.rosbag1 import ReaderError
from rosbags.rosbag1.reader import Header, RecordType
from rosbags.rosbag2.reader import DirectoryReader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader
from rosbags.typesys.msg import normalize_msgtype

from harvey.errors import BadInput
from harvey_ros2.messages.messages import BAD, message_types, ros_one_store
from world_models.files.regular_files import expect_regular, read_regular
from world_models.words import by_numbers

MCAP, SQLITE, ROS_ONE, ZSTD = b"\x89MCAP0\r\n", b"SQLite format 3\0", b"#ROSBAG V", b"\x28\xb5\x2f\xfd"
ENDINGS = (".mcap", ".db3", ".bag")
MOST_BYTES = 1 << 30
"""No record, and no chunk that is unpacked, is larger."""
MOST_METADATA = 10_000_000
UNPACKERS = {"zstd": lambda: zstandard.ZstdDecompressor().decompressobj(), "lz4": LZ4FrameDecompressor,
             "bz2": bz2.BZ2Decompressor}
Record = tuple[Connection, int, bytes]
"""The channel, when it was recorded [ns], and the bytes of a message."""


class Storage(Protocol):
    """One opened file: what all readers of rosbags are too."""

    connections: list[Connection]

    def messages(self, connections: list[Connection]) -> Iterator[Record]: ...
    def close(self) -> None: ...


class BagFile:
    """A bag that is opened.

    Attributes:
        connections: its channels, each with topic and type of message.
        broken: why it could not be read to its end, a sentence for each of its files; grows while it is read.
    """

    def __init__(self, path: Path, distro: str) -> None:
        """Raises BadInput where it is none, or cannot be read."""
        self.path, self.broken, self._store = path, list[str](), message_types(distro).store
        self._files: list[Storage] = []
        try:
            files = _list_files(path)
            for file in files:
                self._files.append(self._open(file))
        except Exception as error:  # whatever the several readers raise for a file that is none
            self.close()
            raise BadInput(f"{path}: expected a bag of ROS 1 or 2, got: {_describe(error)}") from None
        self.connections = [one for file in self._files for one in file.connections]

    def close(self) -> None:
        """Let it go."""
        for file in self._files:
            file.close()

    def messages(self, wanted: Collection[Connection]) -> Iterator[Record]:
        """The messages of some channels in the order in which they were recorded."""
        yield from merge(*(self._read(file, wanted) for file in self._files), key=lambda record: record[1])

    def decode(self, connection: Connection, data: bytes) -> Any:
        """A message; None where its bytes are none of its type."""
        try:
            if isinstance(connection.owner, RosOneReader | _BrokenRosOne) or _is_coded(connection, "ros1"):
                return ros_one_store().deserialize_ros1(data, connection.msgtype)
            return self._store.deserialize_cdr(data, connection.msgtype)
        except (*BAD, KeyError, UnicodeDecodeError):
            return None

    def _open(self, path: Path) -> Storage:
        if path.is_dir():
            reader = DirectoryReader(path)
            reader.open()
            return reader
        with path.open("rb") as file:
            begin = file.read(16)
        if begin.startswith(MCAP):
            return _open_mcap(path, self.broken)
        if begin.startswith(ROS_ONE):
            try:
                old = RosOneReader(path)
                old.open()
            except Exception:  # without an index, or a damaged one
                return _BrokenRosOne(path, self.broken)
            return old
        if not begin.startswith(SQLITE):
            raise ValueError(
                f"{path.name} is compressed as a whole: unpack it first (zstd -d)" if begin.startswith(ZSTD) else
                f"{path.name} begins as none: neither as mcap, nor as sqlite3, nor as #ROSBAG")
        rows = Sqlite3Reader(path)
        rows.open()
        return rows

    def _read(self, file: Storage, wanted: Collection[Connection]) -> Iterator[Record]:
        """The messages of one file, up to where it is damaged."""
        own = [one for one in file.connections if one in wanted]
        names = {(one.topic, one.msgtype) for one in own}
        try:
            for record in file.messages(own) if own else ():
                if (record[0].topic, record[0].msgtype) in names:  # a damaged index leads to others
                    yield record
        except Exception as error:  # whatever the several readers raise
            self._say(f"it is damaged, and read up to there: {_describe(error)}")

    def _say(self, what: str) -> None:
        if what not in self.broken:
            self.broken.append(what)


class _Indexed:
    """An mcap with an index: messages in the order of their times, chunk by chunk."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("rb")
        try:
            self._reader = SeekingReader(self._file, validate_crcs=True, record_size_limit=MOST_BYTES)
            summary = self._reader.get_summary()
            if summary is None or not summary.chunk_indexes or not summary.channels:
                raise ValueError("no index")
            self._connections = {key: _connect(channel, summary.schemas.get(channel.schema_id), self)
                                 for key, channel in summary.channels.items()}
        except BaseException:
            self._file.close()
            raise
        self.connections = list(self._connections.values())

    def messages(self, connections: list[Connection]) -> Iterator[Record]:
        wanted = {one.id for one in connections}
        for _, channel, message in self._reader.iter_messages({one.topic for one in connections}):
            if channel.id in wanted:
                yield self._connections[channel.id], message.log_time, message.data

    def close(self) -> None:
        self._file.close()


class _Scanned:
    """A file that is read from its beginning on, record by record: one without an index, or that breaks off."""

    def __init__(self, path: Path, broken: list[str]) -> None:
        self._path, self._broken = path, broken
        self._known: dict[int, Connection] = {}
        for _ in self._records():
            pass
        self.connections = list(self._known.values())

    def messages(self, connections: list[Connection]) -> Iterator[Record]:
        wanted = {one.id for one in connections}
        for key, time_ns, data in self._records():
            if key in wanted:
                yield self._known[key], time_ns, data

    def close(self) -> None:
        """Nothing is open between two readings."""

    def _records(self) -> Iterator[tuple[int, int, bytes]]:
        """Channel, time [ns] and bytes of each message that is whole; channels are kept as they come."""
        with self._path.open("rb") as file:
            try:
                yield from self._scan(file)
            except (EOFError, ReaderError, *BAD) as error:
                how = "breaks off after" if isinstance(error, EOFError) else "is damaged before"
                what = f"{self._path.name} {how} {file.tell()} bytes: what is whole till there is read"
                if what not in self._broken:
                    self._broken.append(what)

    def _scan(self, file: BinaryIO) -> Iterator[tuple[int, int, bytes]]:
        raise NotImplementedError


class _ScannedMcap(_Scanned):
    def __init__(self, path: Path, broken: list[str]) -> None:
        self._schemas: dict[int, Schema] = {}
        super().__init__(path, broken)

    def _scan(self, file: BinaryIO) -> Iterator[tuple[int, int, bytes]]:
        file.seek(len(MCAP))
        yield from self._take(file)

    def _take(self, file: BinaryIO, *, within: bool = False) -> Iterator[tuple[int, int, bytes]]:
        """Of a file, or of an unpacked chunk, which ends without a mark."""
        while head := file.read(9):
            code, size = struct.unpack("<BQ", _whole(head, 9))
            if code in (Opcode.DATA_END, Opcode.FOOTER):
                return
            if code not in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.CHUNK):
                file.seek(size, 1)
                continue
            data = file.read(min(size, MOST_BYTES))
            stream = ReadDataStream(BytesIO(data))
            if code == Opcode.CHUNK and not within:
                yield from self._unpack(data)
                _whole(data, size)
                continue
            _whole(data, size)
            if code == Opcode.SCHEMA:
                schema = Schema.read(stream)
                self._schemas[schema.id] = schema
            elif code == Opcode.CHANNEL:
                channel = Channel.read(stream)
                self._known.setdefault(channel.id, _connect(channel, self._schemas.get(channel.schema_id), self))
            elif code == Opcode.MESSAGE:
                message = Message.read(stream, size)
                if message.channel_id in self._known:
                    yield message.channel_id, message.log_time, message.data
        if not within:
            raise EOFError

    def _unpack(self, data: bytes) -> Iterator[tuple[int, int, bytes]]:
        """The records of a chunk; of one that breaks off those that are whole."""
        chunk = Chunk.read(ReadDataStream(BytesIO(data)))
        yield from self._take(BytesIO(_unpack(chunk.data, chunk.compression)), within=True)


class _BrokenRosOne(_Scanned):
    """A bag of ROS 1 without its index, as one that was not closed (``.bag.active``)."""

    def _scan(self, file: BinaryIO) -> Iterator[tuple[int, int, bytes]]:
        file.readline()
        yield from self._take(file)

    def _take(self, file: BinaryIO, *, within: bool = False) -> Iterator[tuple[int, int, bytes]]:
        while length := file.read(4):
            header_size, = struct.unpack("<L", _whole(length, 4))
            head = Header.read(BytesIO(length + _whole(file.read(min(header_size, MOST_BYTES)), header_size)))
            size, = struct.unpack("<L", _whole(file.read(4), 4))
            data, code = file.read(size), head.get_uint8("op")
            if code == RecordType.CHUNK and not within:
                packed = head.get_string("compression")
                yield from self._take(BytesIO(_unpack(data, "" if packed == "none" else packed)), within=True)
            _whole(data, size)
            if code == RecordType.CONNECTION:
                key, about = head.get_uint32("conn"), Header.read(BytesIO(struct.pack("<L", size) + data))
                self._known.setdefault(key, Connection(
                    key, head.get_string("topic"), normalize_msgtype(about.get_string("type")),
                    MessageDefinition(MessageDefinitionFormat.NONE, ""), "", 0, ConnectionExtRosbag2("ros1", []), self))
            elif code == RecordType.MSGDATA and head.get_uint32("conn") in self._known:
                yield head.get_uint32("conn"), head.get_time("time"), data
        if not within:
            raise EOFError


def _open_mcap(path: Path, broken: list[str]) -> Storage:
    try:
        return _Indexed(path)
    except Exception:  # whatever the library raises where the end of the file is not there
        return _ScannedMcap(path, broken)


def _connect(channel: Channel, schema: Schema | None, owner: object) -> Connection:
    kind = "" if schema is None else schema.name
    return Connection(channel.id, channel.topic, normalize_msgtype(kind) if kind.count("/") == 1 else kind,
                      MessageDefinition(MessageDefinitionFormat.NONE, ""), "", 0,
                      ConnectionExtRosbag2(channel.message_encoding, []), owner)


def _is_coded(connection: Connection, how: str) -> bool:
    return getattr(connection.ext, "serialization_format", "") == how


def _unpack(data: bytes, packed: str) -> bytes:
    """What a chunk holds, as far as it is there. Raises ValueError."""
    if not packed or packed == "none":
        return data
    if packed not in UNPACKERS:
        raise ValueError(f"chunks packed by {packed!r}")
    try:
        unpacked: bytes = UNPACKERS[packed]().decompress(data)
    except (RuntimeError, OSError, zstandard.ZstdError) as error:
        raise ValueError(str(error)) from None
    return unpacked


def _whole(data: bytes, size: int) -> bytes:
    if len(data) < size:
        raise EOFError
    return data


def _list_files(path: Path) -> list[Path]:
    """The files of a bag; its folder itself where the files in it are packed. Raises OSError."""
    if not path.is_dir():
        expect_regular(path)
        return [path]
    for one in path.iterdir():
        if not one.is_dir():
            expect_regular(one)
    metadata = path / "metadata.yaml"
    text = read_regular(metadata, MOST_METADATA).decode("utf-8", "replace") if metadata.exists() else ""
    if re.search(r"compression_mode:\s*[\"']?(file|message)", text, re.IGNORECASE):
        return [path]
    files = sorted((one for one in path.iterdir() if one.name.endswith(ENDINGS)), key=by_numbers)
    if not files:
        raise ValueError("a folder without a file of a bag")
    return files


def _describe(error: Exception) -> str:
    if isinstance(error, OSError):
        return error.strerror or str(error)
    return str(error) or type(error).__name__
