"""Compiled worlds: a table of packed locale frames in one SQLite file, each unpacked when it is first asked for.

A frame is packed as JSON, field by field as its dataclass says; the numbers of its arrays follow in little-endian
float64, so that they keep every bit. Layers: a world as the robot knows it, then with each file of details added; a
layer holds the frames in which it differs from the one below.
"""

from __future__ import annotations

import hashlib
import json
import os
import sqlite3
import types
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import fields, is_dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from world_models.building.locale_frame import LocaleFrame
from world_models.building.locales import Doorway, Finding, Link
from world_models.building.world import World, words_about, words_of
from world_models.files.regular_files import expect_regular
from world_models.files.toml.source import WorldError
from world_models.frames import frozen

FORMAT = "harvey world 3"
SUFFIXES = (".world", ".sqlite")
"""Suffixes of compiled worlds."""
SCHEMA = """
create table meta (format text not null, sha256 text not null, about blob not null);
create table frame (number integer not null, layer integer not null, name text not null, packed blob not null);
create table passage (name text primary key, locale text not null, other text not null) without rowid;
create table word (word text not null, number integer not null, name text not null,
                   primary key (word, number)) without rowid;
"""
INDICES = "create index frame_name on frame (name, layer); create index frame_number on frame (layer, number, name);"
"""Made at the end, which is faster."""
MOST_UNPACKED_BYTES = 100_000_000
"""Of one frame."""
VIEWS = "select 1 from sqlite_master where type = 'view' or sql like 'create virtual%' or sql like '%generated%'"
NOT_PACKED = ("changes", "filed", "memo")
"""Fields of a frame that no file has."""


def pack_frame(frame: LocaleFrame) -> bytes:
    """A frame as bytes, for :func:`unpack_frame`."""
    numbers: list[bytes] = []
    words = json.dumps(_pack(frame, numbers), separators=(",", ":")).encode()
    return zlib.compress(len(words).to_bytes(4, "little") + words + b"".join(numbers), 1)


def _pack(value: Any, numbers: list[bytes]) -> Any:
    """A value as JSON has it; arrays by their shape, and their numbers into ``numbers``."""
    if isinstance(value, np.ndarray):
        numbers.append(np.ascontiguousarray(value, "<f8").tobytes())
        return value.shape
    if is_dataclass(value):
        return [_pack(getattr(value, field.name), numbers) for field in fields(value) if field.name not in NOT_PACKED]
    if isinstance(value, Mapping):
        return dict(value)
    return [_pack(item, numbers) for item in value] if isinstance(value, tuple) else value


def unpack_frame(packed: bytes) -> LocaleFrame:
    """A frame of bytes from :func:`pack_frame`.

    Raises:
        ValueError, TypeError, LookupError, zlib.error: the bytes are something else.
    """
    data = _decompress(packed)
    end = 4 + int.from_bytes(data[:4], "little")
    frame: LocaleFrame = _unpack(LocaleFrame, json.loads(data[4:end]), _Numbers(data, end))
    return frame


def _decompress(packed: bytes) -> bytes:
    """As zlib.decompress; a few bytes that stand for more than may be are refused."""
    unpacked = zlib.decompressobj()
    data = unpacked.decompress(packed, MOST_UNPACKED_BYTES)
    if not unpacked.eof:
        raise ValueError(f"a piece that is cut off, or of more than {MOST_UNPACKED_BYTES} bytes")
    return data


class _Numbers:
    """Takes arrays from bytes, one after the other."""

    def __init__(self, data: bytes, at: int) -> None:
        self._data, self._at = data, at

    def take(self, shape: Sequence[int]) -> Any:
        count, at = int(np.prod(shape)), self._at
        self._at += 8 * count
        return frozen(np.frombuffer(self._data, "<f8", count, at).reshape(shape))


def _unpack(kind: Any, value: Any, numbers: _Numbers) -> Any:
    """The value of a type from what :func:`_pack` made of it."""
    origin, of = get_origin(kind), get_args(kind)
    if origin is np.ndarray:
        return numbers.take(value)
    if origin in (Union, types.UnionType):
        return None if value is None else _unpack(of[0], value, numbers)
    if origin is tuple:
        kinds = of[:1] * len(value) if of[1:] == (...,) else of
        return tuple(_unpack(each, item, numbers) for each, item in zip(kinds, value, strict=True))
    if not is_dataclass(kind):
        return value
    build: Any = kind
    known = zip(_fields_of(build), value, strict=True)
    return build(**{name: _unpack(each, item, numbers) for (name, each), item in known})


@cache
def _fields_of(kind: Any) -> list[tuple[str, Any]]:
    """Names and types of the fields that are packed."""
    hints = get_type_hints(kind)
    return [(field.name, hints[field.name]) for field in fields(kind) if field.name not in NOT_PACKED]


def compile_world(layers: Sequence[World], out: Path, details: Sequence[str] = ()) -> None:
    """Write a world to a compiled file.

    Args:
        layers: the world as the robot knows it, then with each file of details added.
        out: the file; replaced.
        details: names of the files of details, in that order.

    Raises:
        WorldError: the file cannot be written.
    """
    frames, counts = [layer.frames.values() for layer in layers], [layer.counts() for layer in layers]
    write_frames(out, frames, counts, details, [(fault.source, fault.what) for fault in layers[-1].building_faults])


def write_frames(out: Path, layers: Sequence[Iterable[LocaleFrame]], counts: Sequence[Mapping[str, int]],
                 details: Sequence[str] = (), faults: Sequence[tuple[str, str]] = ()) -> None:
    """Write frames as they come, root first, layer by layer; see :func:`compile_world`."""
    partial = out.with_name(out.name + ".partial")
    try:
        partial.unlink(missing_ok=True)
        with closing(sqlite3.connect(partial)) as file:
            file.executescript("pragma journal_mode = off; pragma synchronous = off;" + SCHEMA)
            known: dict[str, bytes] = {}
            for layer, frames in enumerate(layers):
                for frame in frames:
                    packed = pack_frame(frame)
                    digest = hashlib.sha256(packed).digest()
                    if known.get(frame.name) != digest:
                        row = frame.extent.number, layer, frame.name, packed
                        file.execute("insert into frame values (?, ?, ?, ?)", row)
                    if layer == 0:
                        _index(file, frame)
                    known[frame.name] = digest
            about = json.dumps({"name": next(iter(known)), "names": _digest_of(known), "details": list(details),
                                "counts": [dict(each) for each in counts], "faults": list(faults)}).encode()
            sha256 = hashlib.sha256(b"".join((about, *known.values()))).hexdigest()
            file.execute("insert into meta values (?, ?, ?)", (FORMAT, sha256, zlib.compress(about)))
            file.commit()
            file.executescript(INDICES)
        os.replace(partial, out)
    except (OSError, sqlite3.Error) as error:
        raise WorldError(f"{out}: expected a file that a world can be compiled to, got: {error}") from None
    finally:
        partial.unlink(missing_ok=True)


def _index(file: sqlite3.Connection, frame: LocaleFrame) -> None:
    """Enter by which words a locale is found, and where its passages are."""
    number, name = frame.extent.number, frame.name
    file.executemany("insert into word values (?, ?, ?)",
                     ((word, number, name) for word in sorted(words_about(frame.locale))))
    passages: tuple[Doorway | Link, ...] = (*frame.links, *frame.doorways)
    file.executemany("insert or ignore into passage values (?, ?, ?)",
                     ((passage.name, name, passage.other(name)) for passage in passages))


def _digest_of(names: Iterable[str]) -> str:
    return hashlib.sha256("\n".join(names).encode()).hexdigest()


class PackedFrames(Mapping[str, LocaleFrame]):
    """The frames of a compiled world by name, each unpacked when it is first asked for.

    Attributes:
        about: name of the world, names of its details, and by layer how much there is.
        sha256: digest of the contents; stored in the file, so that a large one need not be read for it.
        touched: the locales whose frames were unpacked so far, in order.
    """

    def __init__(self, path: Path, details: Sequence[str] = ()) -> None:
        """Open a compiled world. Raises WorldError where it is none, or was compiled with other details."""
        self._path = path
        self.touched: list[str] = []
        self._known: dict[str, LocaleFrame] = {}
        try:
            expect_regular(path)
            self._file = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True, check_same_thread=False)
            if self._file.execute(VIEWS).fetchone() is not None:
                raise ValueError("a view in the place of a table, which could go on for ever")
            found = self._file.execute("select format, sha256, about from meta").fetchall()
        except OSError as error:
            raise WorldError(f"{path}: expected a readable file, got: {error.strerror}") from None
        except (sqlite3.Error, ValueError) as error:
            raise WorldError(f"{path.name}: expected a compiled world, got: {error}") from None
        if (written := found[0][0] if found else None) != FORMAT:
            raise WorldError(f"{path.name}: expected {FORMAT!r}, got {written!r}: compile it anew")
        with self.world_errors():
            self.sha256, self.about = str(found[0][1]), json.loads(_decompress(found[0][2]))
        if details and list(details) != self.about["details"]:
            raise WorldError(f"{path.name}: expected the details that it was compiled with "
                             f"({', '.join(self.about['details']) or 'none'}), got {', '.join(details)}")
        self.layer = len(details)

    @contextmanager
    def world_errors(self) -> Iterator[None]:
        """Turn every error of a broken file into a WorldError."""
        try:
            yield
        except WorldError:
            raise
        except (sqlite3.Error, zlib.error, ValueError, TypeError, LookupError, AttributeError, ArithmeticError,
                RecursionError, MemoryError) as error:
            raise WorldError(f"{self._path.name}: expected a sound compiled world, got: {error!r}") from None

    def verify(self) -> None:
        """Compare the contents with their digest. Raises WorldError where they are others."""
        with self.world_errors():
            said = hashlib.sha256(_decompress(self._file.execute("select about from meta").fetchone()[0]))
            known: dict[str, bytes] = {}
            for name, packed in self._file.execute("select name, packed from frame order by number, layer"):
                known[name] = hashlib.sha256(packed).digest()
            said.update(b"".join(known.values()))
            if said.hexdigest() != self.sha256:
                raise ValueError("other contents than were compiled")

    def rows(self, query: str, *values: Any) -> list[tuple[Any, ...]]:
        """The answer to a query of the file. Raises WorldError."""
        with self.world_errors():
            return self._file.execute(query, values).fetchall()

    def __getitem__(self, name: str) -> LocaleFrame:
        if name not in self._known:
            rows = self.rows("select packed from frame where name = ? and layer <= ? order by layer desc limit 1",
                             name, self.layer)
            if not rows and name not in self._names:
                raise KeyError(name)
            with self.world_errors():
                frame = unpack_frame(rows[0][0])
                if frame.name != name:
                    raise ValueError(f"the frame of {frame.name!r} under {name!r}")
            self._known[name] = frame
            self.touched.append(name)
        return self._known[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    @cached_property
    def _names(self) -> dict[str, None]:
        names = [str(row[0]) for row in self.rows("select name from frame where layer = 0 order by number")]
        if _digest_of(names) != self.about["names"]:
            raise WorldError(f"{self._path.name}: expected a sound compiled world, got one with other names")
        return dict.fromkeys(names)


class PackedWorld(World):
    """A compiled world: locales and passages are found by name without reading all frames."""

    frames: PackedFrames

    def __init__(self, frames: PackedFrames) -> None:
        with frames.world_errors():
            faults = [Finding(source, what) for source, what in frames.about["faults"]]
            super().__init__(frames, faults, frames.about["name"])

    def named(self, words: str) -> Sequence[str]:
        wanted = sorted(words_of(words))
        marks = ", ".join("?" * len(wanted))
        return [row[0] for row in self.frames.rows(
            f"select name from word where word in ({marks}) group by number having count(*) = ? order by number",
            *wanted, len(wanted))]

    def find_passage(self, name: str) -> Doorway | Link | None:
        locales = [row[0] for row in self.frames.rows("select locale from passage where name = ?", name)]
        passages: list[Doorway | Link] = [link for locale in locales for link in self.links_of(locale)]
        passages += [doorway for locale in locales for doorway in self.doorways_of(locale)]
        return next((passage for passage in passages if passage.name == name), None)

    def counts(self) -> Mapping[str, int]:
        counts: dict[str, int] = self.frames.about["counts"][self.frames.layer]
        return counts
