"""Reading a world: from TOML that people write (``worlds/research_center.toml`` is annotated), or a compiled file."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache, lru_cache
from os import PathLike
from pathlib import Path

from world_models.building.world import World
from world_models.files.construction.builder import build_world
from world_models.files.construction.specs import WorldSpec
from world_models.files.packed import FORMAT, SUFFIXES, PackedFrames, compile_world, open_world
from world_models.files.toml.other_files import compute_digest
from world_models.files.toml.settings_reader import suggest_keys
from world_models.files.toml.source import WORLDS, Source, WorldError
from world_models.files.toml.world_reader import WorldReader

__all__ = ["SUFFIXES", "WORLDS", "WorldError", "compile_file", "fingerprint", "load_world", "read_world"]

WORTH_KEEPING_FACES = 1000
"""A building with fewer is built as fast as it is read."""
MOST_KEPT = 32
"""Buildings that are kept; the oldest goes."""


def load_world(path: str | PathLike[str], *, details: Sequence[str | PathLike[str]] = (),
               opened: Collection[str] = (), altered: Callable[[WorldSpec], WorldSpec] | None = None) -> World:
    """The world of a TOML file, or of a compiled one, which is read one locale at a time.

    The last few worlds are kept: files with the same contents give the same object.

    Args:
        path: the world file.
        details: further files that add parts, finishes and things (no rooms or doors).
        opened: closed doors between two locales that are built open.
        altered: makes another description of the one that was read.

    Raises:
        WorldError: a file cannot be read or does not describe a world; names file, line, what was expected and got.
            Also where a compiled world is to be changed.
    """
    path = Path(path)
    if path.suffix in SUFFIXES:
        if details or opened or altered is not None:
            raise WorldError(f"{path}: expected a TOML file where details are added, closed doors opened or the "
                             "description altered, got a compiled world")
        return open_world(path)
    files = (path, *map(Path, details))
    if altered is not None:
        return _read_files(files, opened, altered)
    try:
        digests = tuple(compute_digest(file) for file in files)
    except (OSError, WorldError):
        return _read_files(files, opened)  # which says what is wrong
    return _read_once(files, digests, tuple(opened))


@lru_cache(maxsize=2)  # the true one and the believed one
def _read_once(files: tuple[Path, ...], digests: tuple[str, ...], opened: tuple[str, ...]) -> World:
    """The world of files with these digests: built once, then kept compiled where a user's caches are."""
    said = repr((FORMAT, _digest_code(), [str(file) for file in files], digests, opened))
    kept = _find_cache() / f"{hashlib.sha256(said.encode()).hexdigest()}.world"
    with suppress(WorldError):
        world = open_world(kept)
        return World(dict(world.frames), world.building_faults)
    world = _read_files(files, opened)
    if len(world.faces) >= WORTH_KEEPING_FACES and kept.is_absolute():  # where somebody has no home it is not
        _keep(world, kept)
    return world


def _find_cache() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")) / "harvey" / "worlds"


@cache
def _digest_code() -> str:
    """SHA-256 of the code that builds a world: what another version built is built again."""
    root = Path(__file__).parents[1]
    return hashlib.sha256(b"".join(path.read_bytes() for path in sorted(root.rglob("*.py")))).hexdigest()


def _keep(world: World, kept: Path) -> None:
    """Write a world under its name, at once and whole; where that cannot be, it is built again next time."""
    own = kept.with_suffix(f".{os.getpid()}")
    with suppress(OSError, WorldError, TypeError):
        kept.parent.mkdir(parents=True, exist_ok=True)
        compile_world(world, own)
        os.replace(own, kept)
        for old in sorted(kept.parent.glob("*.world"), key=os.path.getmtime)[:-MOST_KEPT]:
            old.unlink(missing_ok=True)


def _read_files(files: Sequence[Path], opened: Collection[str],
                altered: Callable[[WorldSpec], WorldSpec] | None = None) -> World:
    base, *details = [Source.read(file) for file in files]
    return read_world(base, details, opened, altered)


def fingerprint(path: str | PathLike[str]) -> str:
    """SHA-256 of a world file with its includes, or of a compiled world's contents. Raises OSError or WorldError."""
    path = Path(path)
    return PackedFrames(path).sha256 if path.suffix in SUFFIXES else compute_digest(path)


def compile_file(path: str | PathLike[str], out: str | PathLike[str],
                 details: Sequence[str | PathLike[str]] = ()) -> World:
    """Compile a TOML world with its details into one file; returns that world. Raises WorldError."""
    world = load_world(path, details=details)
    compile_world(world, Path(out))
    return world


def read_world(base: Source, details: Sequence[Source] = (), opened: Collection[str] = (),
               altered: Callable[[WorldSpec], WorldSpec] | None = None) -> World:
    """The world of files already read; see :func:`load_world`."""
    reader = WorldReader(base)
    reader.read_base()
    for source in details:
        reader.read_details(source)
    spec = reader.spec()
    spec = _with_open_doors(spec, opened) if opened else spec
    return build_world(spec if altered is None else altered(spec))


def _with_open_doors(spec: WorldSpec, opened: Collection[str]) -> WorldSpec:
    closed = [door.name for door in spec.doors if not door.is_open and len(door.between) == 2]
    for name in opened:
        if name not in closed:
            near = suggest_keys(name, closed)
            raise WorldError(f"expected a closed door between two locales, {near}, got {name!r}")
    return replace(spec, doors=tuple(replace(d, is_open=d.is_open or d.name in opened) for d in spec.doors))
