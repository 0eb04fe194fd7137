"""A thing, a landmark or a face that is gone.

A landmark that is gone keeps its number and its name, but has no lines any more: what was seen of it has a name still.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from world_models.building.geometry.landmarks import Edges
from world_models.building.geometry.scene import LocaleGeometry
from world_models.building.things import Thing

Parts = tuple[LocaleGeometry, ...]


def remove_thing(parts: Parts, things: tuple[Thing, ...], name: str) -> tuple[Parts, tuple[Thing, ...]]:
    """The geometry and the things of a locale without one thing, its faces and its landmark's lines.

    What stands near it, or on top of it, stays: the model does not say what carries what.

    Raises:
        ValueError: none of the things has this name.
    """
    kept = tuple(thing for thing in things if thing.name != name)
    if len(kept) == len(things):
        raise ValueError(f"expected one of the things {', '.join(t.name for t in things) or '(none)'}, got {name!r}")
    return _remove(parts, lambda known: known == name or known.startswith(f"{name}/")), kept


def remove_element(parts: Parts, name: str) -> Parts:
    """The geometry of a locale without the face of this name, and without the lines of the landmark of this name.

    A wall and its trim have one name, and go together.

    Raises:
        ValueError: none of its faces and landmarks has this name.
    """
    if name not in element_names(parts):
        locales = sorted({part.locale for part in parts})
        raise ValueError(f"expected the name of a face or landmark of {', '.join(locales)}, got {name!r}")
    return _remove(parts, lambda known: known == name)


def element_names(parts: Parts) -> frozenset[str]:
    """The names of all faces and landmarks."""
    faces = (face.name for part in parts for _, face in part.faces)
    return frozenset(faces).union(mark.name for part in parts for _, mark in part.landmarks)


def _remove(parts: Parts, is_gone: Callable[[str], bool]) -> Parts:
    """The same parts where nothing is gone."""
    return tuple(_remove_from(part, is_gone) if any(map(is_gone, element_names((part,)))) else part for part in parts)


def _remove_from(part: LocaleGeometry, is_gone: Callable[[str], bool]) -> LocaleGeometry:
    no_edges = Edges.from_rows(())
    faces = tuple((number, face) for number, face in part.faces if not is_gone(face.name))
    landmarks = tuple((n, replace(mark, edges=no_edges) if is_gone(mark.name) else mark) for n, mark in part.landmarks)
    return replace(part, faces=faces, landmarks=landmarks)
