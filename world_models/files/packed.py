"""Compiled worlds: a table of packed locale frames in one SQLite file, each unpacked when it is first asked for.

A frame is packed as JSON, field by field as its dataclass says; the numbers of its arrays follow in little-endian
float64, so that they keep every bit.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import sqlite3
import types
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from world_models.building.locale_frame import LocaleFrame
from world_models.building.locales import Finding
from world_models.building.world import World
from world_models.files.regular_files import expect_regular
from world_models.files.toml.source import WorldError
from world_models.frames import frozen

FORMAT = "harvey world 4"
SUFFIXES = (".world", ".sqlite")
"""Suffixes of compiled worlds."""
SCHEMA = """
create table meta (format text not null, sha256 text not null, about blob not null);
create table frame (name text primary key, packed blob not null) without rowid;
"""
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
    frame: LocaleFrame = _unpacker_of(LocaleFrame)(json.loads(data[4:end]), _Numbers(data, end))
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
        count, at = math.prod(shape), self._at
        self._at += 8 * count
        return frozen(np.frombuffer(self._data, "<f8", count, at).reshape(shape))


@cache
def _unpacker_of(kind: Any) -> Callable[[Any, _Numbers], Any]:
    """Makes values of a type from what :func:`_pack` made of them; found once, as a building has thousands."""
    origin, of = get_origin(kind), get_args(kind)
    if origin is np.ndarray:
        return lambda value, numbers: numbers.take(value)
    if origin in (Union, types.UnionType):
        one = _unpacker_of(of[0])
        return lambda value, numbers: None if value is None else one(value, numbers)
    if origin is tuple and of[1:] == (...,):
        each = _unpacker_of(of[0])
        return lambda value, numbers: tuple([each(item, numbers) for item in value])
    if origin is tuple:
        parts = [_unpacker_of(part) for part in of]
        return lambda value, numbers: tuple([
            unpack(item, numbers) for unpack, item in zip(parts, value, strict=True)])
    if not is_dataclass(kind):
        return lambda value, numbers: value
    build: Any = kind
    hints = get_type_hints(kind)
    known = {field.name: _unpacker_of(hints[field.name]) for field in fields(kind) if field.name not in NOT_PACKED}
    return lambda value, numbers: build(**{
        name: unpack(item, numbers) for (name, unpack), item in zip(known.items(), value, strict=True)})


def compile_world(world: World, out: Path) -> None:
    """Write a world to a compiled file; what was there is replaced. Raises WorldError where it cannot be written."""
    partial = out.with_name(out.name + ".partial")
    about = json.dumps({"names": list(world.frames),
                        "faults": [(fault.source, fault.what) for fault in world.building_faults]}).encode()
    digest = hashlib.sha256(about)
    try:
        partial.unlink(missing_ok=True)
        with closing(sqlite3.connect(partial)) as file:
            file.executescript("pragma journal_mode = off; pragma synchronous = off;" + SCHEMA)
            for name, frame in world.frames.items():
                packed = pack_frame(frame)
                digest.update(packed)
                file.execute("insert into frame values (?, ?)", (name, packed))
            file.execute("insert into meta values (?, ?, ?)", (FORMAT, digest.hexdigest(), zlib.compress(about)))
            file.commit()
        os.replace(partial, out)
    except (OSError, sqlite3.Error) as error:
        raise WorldError(f"{out}: expected a file that a world can be compiled to, got: {error}") from None
    finally:
        partial.unlink(missing_ok=True)


def open_world(path: Path) -> World:
    """A compiled world. Raises WorldError where the file is none."""
    frames = PackedFrames(path)
    with frames.world_errors():
        return World(frames, [Finding(source, what) for source, what in frames.about["faults"]])


class PackedFrames(Mapping[str, LocaleFrame]):
    """The frames of a compiled world by name, each unpacked when it is first asked for.

    Attributes:
        about: the names of its locales, root first, and the faults of its building.
        sha256: digest of the contents; stored in the file, so that a large one need not be read for it.
        touched: the locales whose frames were unpacked so far, in order.
    """

    def __init__(self, path: Path) -> None:
        """Open a compiled world. Raises WorldError where it is none."""
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
            raise WorldError(f"{path.name}: expected {FORMAT!r}, got {written!r}: compile it again")
        with self.world_errors():
            self.sha256, self.about = str(found[0][1]), json.loads(_decompress(found[0][2]))
            self._names = dict.fromkeys(self.about["names"])

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
            packed = dict(self._file.execute("select name, packed from frame"))
            for name in self._names:
                said.update(packed.pop(name))
            if packed or said.hexdigest() != self.sha256:
                raise ValueError("other contents than were compiled")

    def __getitem__(self, name: str) -> LocaleFrame:
        if name not in self._names:
            raise KeyError(name)
        if name not in self._known:
            with self.world_errors():
                rows = self._file.execute("select packed from frame where name = ?", (name,)).fetchall()
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
