"""Reading a world: from TOML that people write (``worlds/research_center.toml`` is annotated), or a compiled file."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from functools import lru_cache
from os import PathLike
from pathlib import Path

from world_models.building.world import World
from world_models.files.construction.builder import build_world
from world_models.files.construction.specs import WorldSpec
from world_models.files.packed import SUFFIXES, PackedFrames, compile_world, open_world
from world_models.files.toml.other_files import compute_digest
from world_models.files.toml.settings_reader import suggest_keys
from world_models.files.toml.source import WORLDS, Source, WorldError
from world_models.files.toml.world_reader import WorldReader

__all__ = ["SUFFIXES", "WORLDS", "WorldError", "compile_file", "fingerprint", "load_world", "read_world"]


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
    """The world of files with these digests."""
    return _read_files(files, opened)


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
