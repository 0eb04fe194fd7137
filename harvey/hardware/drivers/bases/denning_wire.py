"""Frames of the Denning-style line protocol: encoding what is said to a base, decoding what it says.

One frame is one line of ASCII, ``#TOKEN SEQ VERB ARGUMENTS*CRC``; the CRC-32 (that of zlib) of what stands between
``#`` and ``*`` is in eight capital hexadecimal digits. Numbers are written so that reading them gives the same number
back. Source: docs/protocol-denning.md.
"""

from __future__ import annotations

import math
import re
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import get_args

from world_models.entries.touch import Contact, Ranges, Sense

LONGEST = 200
"""Bytes of a line; more without an end is noise."""

_LINE = re.compile(rb"#([0-9A-F]{8} (?:0|[1-9][0-9]{0,8}) [A-Z]+(?: [ -)+-~]+)?)\*([0-9A-F]{8})", re.ASCII)
_WHOLE = re.compile(r"[0-9]{1,6}", re.ASCII)
_NUMBER = re.compile(r"-?[0-9]+(\.[0-9]+)?(e[+-]?[0-9]+)?", re.ASCII)


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame.

    Attributes:
        token: names the session; eight hexadecimal digits.
        seq: of the command that it is about.
        verb: what is said.
        words: the arguments.
    """

    token: str
    seq: int
    verb: str
    words: tuple[str, ...] = ()

    def numbers(self, first: int, count: int) -> tuple[float, ...] | None:
        """``count`` finite numbers from the word ``first`` on, the last of the frame; None where they are not there."""
        words = self.words[first:]
        if len(words) != count or not all(_NUMBER.fullmatch(word) for word in words):
            return None
        values = tuple(float(word) for word in words)
        return values if all(math.isfinite(value) for value in values) else None


def encode(frame: Frame) -> bytes:
    """The line of a frame."""
    body = " ".join((frame.token, str(frame.seq), frame.verb, *frame.words)).encode("ascii")
    return b"#%b*%08X\n" % (body, zlib.crc32(body))


def decode(line: bytes) -> Frame | None:
    """The frame of a line without its end; None where it is none, or was garbled."""
    match = _LINE.fullmatch(line)
    if match is None or zlib.crc32(match[1]) != int(match[2], 16):
        return None
    token, seq, verb, *words = match[1].decode("ascii").split(" ")
    return Frame(token, int(seq), verb, tuple(words))


class Decoder:
    """Frames out of whatever bytes come; what is no frame is passed over and counted.

    Attributes:
        rejected: lines that were none.
    """

    def __init__(self) -> None:
        self._rest = b""
        self.rejected = 0

    def feed(self, data: bytes) -> Iterator[Frame]:
        """The frames that are complete with these bytes."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        self._rest = self._rest[-LONGEST:]
        for line in lines:
            frame = decode(line[max(0, line.rfind(b"#")):])
            if frame is not None:
                yield frame
            else:
                self.rejected += 1

    def clear(self) -> None:
        """Forget a line that was begun."""
        self._rest = b""


def parse_contact(frame: Frame) -> Contact | None:
    """The contact of a ``FELT``; None where nothing was touched, or it is none."""
    values, sense = frame.numbers(1, 3), next((s for s in get_args(Sense) if frame.words[:1] == (s,)), None)
    if values is None or sense is None or not (abs(values[0]) <= math.pi and values[1] > 0.0):
        return None
    return Contact(sense, *values)


def parse_ranges(words: Sequence[str], when_s: float) -> Ranges | None:
    """The ranges of an ``ECHOES`` without its question; None where the base has no sensors, or it is none.

    Words: sigma [mm], half of the beam [mrad], furthest echo [mm], then the distance of each sensor [mm] or ``-``.
    """
    if len(words) < 4 or not all(_WHOLE.fullmatch(word) or (word == "-" and at > 2) for at, word in enumerate(words)):
        return None
    sigma_m, half_beam_rad, max_range_m = (int(word) / 1000.0 for word in words[:3])
    distances = tuple(None if word == "-" else int(word) / 1000.0 for word in words[3:])
    axes = tuple(math.remainder(math.tau * at / len(distances), math.tau) for at in range(len(distances)))
    return Ranges(axes, distances, sigma_m, half_beam_rad, max_range_m, when_s)


def number(value: float) -> str:
    """A number as it is written: what ``float`` reads back is the same number."""
    return repr(float(value))
