"""TOML files whose values know their file and line, so that every error can name them."""

from __future__ import annotations

import re
import tomllib
from bisect import bisect_right
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from world_models.files.regular_files import read_regular

Key = tuple[str | int, ...]
"""The path to a value: table names, keys and positions in arrays, from the top of the file."""


def find_line_numbers(text: str) -> dict[Key, int]:
    """The line (from 1) on which each value of a valid TOML text starts."""
    return TomlScanner(text).scan()


@dataclass
class TomlScanner:
    """Scans TOML that ``tomllib`` has accepted, and notes where values start."""

    text: str
    at: int = 0
    lines: dict[Key, int] = field(default_factory=dict)
    counts: dict[Key, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._newlines = [match.start() for match in re.finditer("\n", self.text)]

    def scan(self) -> dict[Key, int]:
        table: Key = ()
        while self._skip(r"(?:\s|#[^\n]*)*"):
            if self.text.startswith("[", self.at):
                table = self._header()
            else:
                self._pair(table)
        return self.lines

    def _skip(self, pattern: str) -> bool:
        """Move past the pattern; says whether text is left."""
        match = re.compile(pattern).match(self.text, self.at)
        self.at = match.end() if match else self.at
        return self.at < len(self.text)

    def _note(self, key: Key) -> None:
        """The value of this key starts here, and those that hold it no later."""
        line = bisect_right(self._newlines, self.at - 1) + 1
        for length in range(len(key), 0, -1):
            self.lines.setdefault(key[:length], line)

    def _header(self) -> Key:
        double = self.text.startswith("[[", self.at)
        start, self.at = self.at, self.at + (2 if double else 1)
        path: Key = ()
        names = self._dotted()
        for depth, name in enumerate(names):
            path = (*path, name)
            if double and depth == len(names) - 1:
                self.counts[path] = self.counts.get(path, -1) + 1
            if path in self.counts:
                path = (*path, self.counts[path])
        end, self.at = self.at, start
        self._note(path)
        self.at = end
        self._skip(r"\s*\]\]?")
        return path

    def _dotted(self) -> list[str]:
        names = []
        while True:
            self._skip(r"[ \t]*")
            start = self.at
            self._skip(_STRING + r"|[A-Za-z0-9_-]+")
            raw = self.text[start : self.at]
            names.append(next(iter(tomllib.loads(raw + "=0"))))
            self._skip(r"[ \t]*")
            if not self.text.startswith(".", self.at):
                return names
            self.at += 1

    def _pair(self, table: Key) -> None:
        key: Key = (*table, *self._dotted())
        self._skip(r"[ \t]*=[ \t]*")
        self._value(key)

    def _value(self, key: Key) -> None:
        self._note(key)
        opening = self.text[self.at]
        if opening == "[":
            self._array(key)
        elif opening == "{":
            self._inline_table(key)
        elif opening in "\"'":
            self._skip(_STRING)
        else:
            self._skip(r"[^,\]}\n#]*")

    def _array(self, key: Key) -> None:
        self.at += 1
        index = 0
        while self._skip(r"(?:[\s,]|#[^\n]*)*") and self.text[self.at] != "]":
            self._value((*key, index))
            index += 1
        self.at += 1

    def _inline_table(self, key: Key) -> None:
        self.at += 1
        while self._skip(r"(?:[\s,]|#[^\n]*)*") and self.text[self.at] != "}":
            self._pair(key)
        self.at += 1


_STRING = (
    r'"""(?:[^\\]|\\[\s\S])*?"{3,5}'
    r"|'''[\s\S]*?'{3,5}"
    r'|"(?:[^"\\\n]|\\.)*"'
    r"|'[^'\n]*'"
)


MAX_SHOWN = 10**80


class WorldError(ValueError):
    """A world file that cannot be read: names the file, the line, what was expected and what came."""


@dataclass(frozen=True, eq=False)
class Source:
    """One TOML file.

    Attributes:
        name: for messages: the path as it was given.
        data: its tables.
        folder: file names in it are relative to it.
        text: as it was read; "" where the tables come from elsewhere.
        depth: length of the chain of files that name each other, up to this one.
        settings: keys whose values were replaced since it was read (``--set``).
        count: how often it, or a file that it names, named another one; all of them have this one list.
    """

    name: str
    data: Mapping[str, Any]
    folder: Path = Path()
    text: str = ""
    depth: int = 0
    settings: frozenset[Key] = frozenset()
    count: list[int] = field(default_factory=lambda: [0])

    @staticmethod
    def read(path: Path, depth: int = 0) -> Source:
        """Read a file. Raises WorldError where it is missing, not text or not TOML."""
        try:
            text = read_regular(path).decode("utf-8-sig").replace("\r\n", "\n")  # some editors write a byte order mark
            return replace(Source.parse(text, str(path)), folder=path.parent, depth=depth)
        except OSError as error:
            raise WorldError(f"{path}: expected a readable file, got: {error.strerror}") from None
        except UnicodeDecodeError as error:
            raise WorldError(f"{path}: expected UTF-8 text, got byte {error.object[error.start]:#04x} "
                             f"at offset {error.start}") from None

    @staticmethod
    def parse(text: str, name: str = "world") -> Source:
        """Parse a text. Raises WorldError where it is not TOML."""
        try:
            data = tomllib.loads(text)
        except RecursionError:
            raise WorldError(f"{name}: expected at most a few nested arrays, got too many to read") from None
        except ValueError as error:
            match = re.search(r"at line (\d+)", str(error))
            line = match.group(1) if match else text.count("\n") + 1
            raise WorldError(f"{name}:{line}: expected TOML, got: {error}") from None
        return Source(name, data, text=text)

    @cached_property
    def lines(self) -> Mapping[Key, int]:
        """The line, from 1, on which each value starts; found when an error needs it."""
        return find_line_numbers(self.text)

    @property
    def file(self) -> Path:
        """The absolute path: equal for one file, however it is named."""
        return Path(self.name).resolve()

    @property
    def root(self) -> Node:
        return Node(self.data, (), self)

    def where(self, key: Key) -> str:
        """``file:line`` of the value, or of the nearest table that holds it; no line where there was no text."""
        if self.data and not self.lines:
            return self.name
        while key and key not in self.lines:
            key = key[:-1]
        return f"{self.name}:{self.lines.get(key, 1)}"

    def place(self, key: Key) -> str:
        """``file:line: key`` of a value, or ``--set key`` where it, or a value of its table, was replaced."""
        if key and (replaced := [k for k in self.settings if k[: len(key)] == key]):
            return f"--set {'.'.join(map(str, min(replaced)))}"
        return f"{self.where(key)}: {'.'.join(map(str, key)) or 'the file'}"


@dataclass(frozen=True, eq=False)
class Node:
    """A value of a file with its key; every method that reads it raises WorldError with file and line."""

    value: Any
    key: Key
    source: Source

    @property
    def where(self) -> str:
        return self.source.where(self.key)

    @property
    def place(self) -> str:
        return self.source.place(self.key)

    def fail(self, expected: str, got: str | None = None) -> WorldError:
        """The error to raise where this value is not what was expected."""
        came = _shorten(_format_value(self.value)) if got is None else got
        return WorldError(f"{self.place}: expected {expected}, got {came}")

    def table(self, required: tuple[str, ...] = (), optional: tuple[str, ...] = ()) -> Node:
        """This node, after checking that it is a table with all required keys and no unknown ones."""
        if not isinstance(self.value, dict):
            raise self.fail("a table")
        missing = [key for key in required if key not in self.value]
        if missing:
            raise self.fail(f"the key {missing[0]!r}", f"keys {', '.join(self.value) or 'none'}")
        known = (*required, *optional)
        for key in self.value:
            if key not in known:
                raise self[key].fail(f"one of the keys {', '.join(known)}", repr(key))
        return self

    def __contains__(self, key: str) -> bool:
        return key in self.value

    def __getitem__(self, key: str | int) -> Node:
        return Node(self.value[key], (*self.key, key), self.source)

    def get(self, key: str) -> Node | None:
        """The value of a key of this table; None where it is absent."""
        return self[key] if key in self.value else None

    def entries(self) -> Iterator[tuple[str, Node]]:
        """The (name, node) pairs of a table, in the order of the file."""
        if not isinstance(self.value, dict):
            raise self.fail("a table")
        return ((key, self[key]) for key in self.value)

    def entries_of(self, key: str) -> Iterator[tuple[str, Node]]:
        """The (name, node) pairs of the table ``key`` of this table; none where it is absent."""
        node = self.get(key)
        return iter(()) if node is None else node.entries()

    def items(self, min_count: int = 0) -> list[Node]:
        """The elements of an array with at least ``min_count`` of them."""
        if not isinstance(self.value, list) or len(self.value) < min_count:
            raise self.fail(f"an array of at least {min_count} elements" if min_count else "an array")
        return [self[index] for index in range(len(self.value))]

    def text(self) -> str:
        """A non-empty text."""
        if not isinstance(self.value, str) or not self.value:
            raise self.fail("a non-empty text")
        return self.value

    def choice(self, *choices: str) -> str:
        """One of these texts."""
        if self.value not in choices:
            raise self.fail(f"one of {', '.join(choices)}")
        return str(self.value)

    def flag(self) -> bool:
        """True or false."""
        if not isinstance(self.value, bool):
            raise self.fail("true or false")
        return self.value

    def number(self, low: float, high: float) -> float:
        """A number from ``low`` to ``high``."""
        value = self.value
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            raise self.fail(f"a number from {low:g} to {high:g}")
        return float(value)

    def numbers(self, counts: tuple[int, ...], low: float, high: float) -> tuple[float, ...]:
        """An array of numbers from ``low`` to ``high``; ``counts`` are the allowed lengths."""
        if not isinstance(self.value, list) or len(self.value) not in counts:
            raise self.fail(f"an array of {' or '.join(str(count) for count in counts)} numbers")
        return tuple(item.number(low, high) for item in self.items())


def _format_value(value: Any) -> str:
    """A value in TOML notation, for messages."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int) and abs(value) >= MAX_SHOWN:
        return "a number of more than 80 digits"  # Python refuses to format thousands of them
    if isinstance(value, list):
        return f"[{', '.join(_format_value(item) for item in value)}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key} = {_format_value(item)}' for key, item in value.items())}}}"
    return value.isoformat() if hasattr(value, "isoformat") else repr(value)  # dates and times


def _shorten(text: str) -> str:
    return text if len(text) <= 80 else text[:77] + "..."


WORLDS = Path(__file__).parents[2] / "worlds"
"""Folder of the worlds that come with the project; ``parts`` in it holds what they share."""
