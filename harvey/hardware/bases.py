"""Bases by the name of their protocol and the port that they are connected to: ``denning:/dev/ttyUSB0``."""

from __future__ import annotations

import errno
import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from harvey.errors import BadInput
from harvey.hardware.drivers import denning
from harvey.hardware.drivers.base_driver import Base, BaseKind, SerialLink
from world_models.plugins import list_absent, load_plugins

WHY: Mapping[int, str] = {
    errno.ENOENT: "there is no such port",
    errno.EACCES: "you may not use it: sudo usermod -aG dialout $USER, then log in again",
    errno.EBUSY: "another program has it",
    errno.ENODEV: "nothing is plugged in there",
    errno.ENXIO: "nothing is plugged in there",
    errno.EIO: "nothing answers behind it",
    errno.ENOTTY: "it is no serial port",
}


@cache
def base_kinds() -> Mapping[str, BaseKind]:
    """Every kind of base by its name: the project's, then those of other installed packages.

    Raises:
        PluginError: one of another package cannot be loaded.
    """
    return {denning.KIND.name: denning.KIND} | dict(load_plugins("harvey.bases", BaseKind))


def say_what_to_install(name: str) -> str:
    """The end of a message that refuses a kind of base: which extra brings it; "" where none does."""
    needs = list_absent("harvey.bases").get(name)
    return f"; {name} needs {needs}" if needs else ""


def kind_of(port: str) -> tuple[BaseKind, str]:
    """The kind of base, and where it is. Raises BadInput."""
    name, colon, url = port.partition(":")
    kinds = base_kinds()
    if name not in kinds or not colon or not url:
        forms = " or ".join(f"{kind}:PORT" for kind in kinds)
        raise BadInput(f"base: expected {forms}, as {next(iter(kinds))}:/dev/ttyUSB0, got {port!r}"
                       f"{say_what_to_install(name)}")
    return kinds[name], url


def open_base(port: str) -> Base:
    """The base, its port open; whether anything answers is not known yet. Raises BadInput."""
    kind, url = kind_of(port)
    if kind.open_at is not None:
        try:
            return kind.open_at(url)
        except OSError as error:
            raise BadInput(f"base: {error}") from None
    try:
        return kind.connect(SerialLink(url, kind.baud))
    except OSError as error:
        why = WHY.get(_number(error), str(error))
        raise BadInput(f"base: {url}: expected a serial port, but {why}{_others(url)}") from None


def _number(error: OSError) -> int:
    """The system's error number; pyserial gives some of them only as text, as ``... (25, 'Inappropriate ioctl')``."""
    match = re.search(r"\((\d+), ", str(error))
    return error.errno or (int(match[1]) if match else 0)


def _others(url: str) -> str:
    """The serial ports of this machine, for the message."""
    found = sorted(str(p) for pattern in ("ttyUSB*", "ttyACM*", "rfcomm*") for p in Path("/dev").glob(pattern))
    there = [p for p in found if p != url]
    return f"; there are {', '.join(there)}" if there else "; no USB serial port is there at all"
