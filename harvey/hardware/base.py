"""Bases by the name of their protocol and the port that they hang on: ``denning:/dev/ttyUSB0``."""

from __future__ import annotations

import errno
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from harvey.errors import BadInput
from harvey.hardware.drivers.bases import create2, denning, p2os
from harvey.hardware.drivers.bases.base import Base
from harvey.hardware.drivers.bases.create2 import Create2Base
from harvey.hardware.drivers.bases.denning import DenningBase
from harvey.hardware.drivers.bases.link import Link, SerialLink
from harvey.hardware.drivers.bases.p2os import P2osBase


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of base.

    Attributes:
        baud: of its line.
        over: its driver over a line.
        watchdog: what stops it when nobody talks to it any more.
        alone: whether it stops by itself when the line is cut.
    """

    baud: int
    over: Callable[[Link], Base]
    watchdog: str
    alone: bool


KINDS: Mapping[str, Kind] = {
    "denning": Kind(denning.BAUD, DenningBase, "its own, 0.5 s", True),
    "p2os": Kind(p2os.BAUD, P2osBase, "its own, 2 s", True),
    "create2": Kind(create2.BAUD, lambda link: Create2Base(link, guarded=True),
                    "ours, 0.5 s; it has none of its own: a cable that comes off does not stop it", False),
}
WHY: Mapping[int, str] = {
    errno.ENOENT: "there is no such port",
    errno.EACCES: "you may not use it: sudo usermod -aG dialout $USER, then log in anew",
    errno.EBUSY: "another program has it",
    errno.ENODEV: "nothing is plugged in there",
    errno.ENXIO: "nothing is plugged in there",
    errno.EIO: "nothing answers behind it",
    errno.ENOTTY: "it is no serial port",
}


def kind_of(port: str) -> tuple[Kind, str]:
    """The kind of base, and where it is. Raises BadInput."""
    name, colon, url = port.partition(":")
    if name not in KINDS or not colon or not url:
        forms = " or ".join(f"{kind}:PORT" for kind in KINDS)
        raise BadInput(f"base: expected {forms}, as {next(iter(KINDS))}:/dev/ttyUSB0, got {port!r}")
    return KINDS[name], url


def open_base(port: str) -> Base:
    """The base, its port open; whether anything answers is not known yet. Raises BadInput."""
    kind, url = kind_of(port)
    try:
        return kind.over(SerialLink(url, kind.baud))
    except OSError as error:
        why = WHY.get(_number(error), str(error))
        raise BadInput(f"base: {url}: expected a serial port, but {why}{_others(url)}") from None


def _number(error: OSError) -> int:
    """The system's error number; pyserial tells some of them only in words, as ``... (25, 'Inappropriate ioctl')``."""
    told = re.search(r"\((\d+), ", str(error))
    return error.errno or (int(told[1]) if told else 0)


def _others(url: str) -> str:
    """Ports that are there."""
    found = sorted(str(p) for pattern in ("ttyUSB*", "ttyACM*", "rfcomm*") for p in Path("/dev").glob(pattern))
    there = [p for p in found if p != url]
    return f"; there are {', '.join(there)}" if there else "; no USB serial port is there at all"
