"""The line of every value of a TOML text, which tomllib does not keep."""

from __future__ import annotations

import re
import tomllib
from bisect import bisect_right
from dataclasses import dataclass, field

Key = tuple[str | int, ...]
"""The path to a value: table names, keys and positions in arrays, from the top of the file."""


def find_line_numbers(text: str) -> dict[Key, int]:
    """The line (from 1) on which each value of a valid TOML text starts."""
    return _Scanner(text).scan()


@dataclass
class _Scanner:
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
