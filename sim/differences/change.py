"""Changes of a building: faces that are gone and faces that are there instead, for a while."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim.differences.table import Lasting
from world_models.building.geometry.faces import Face


@dataclass(frozen=True, eq=False)
class Change:
    """One difference from the model.

    Attributes:
        lasting: from when to when it holds.
        about: the name of the door or thing; of several changes about the same, the last one that is due holds.
        gone: names of the faces that are not there.
        added: faces that are there.
    """

    lasting: Lasting
    about: str
    gone: frozenset[str] = frozenset()
    added: tuple[Face, ...] = ()


def find_active(changes: Sequence[Change], time_s: float) -> tuple[int, ...]:
    """Which changes hold at a time, ascending."""
    due = {change.about: i for i, change in enumerate(changes)
           if change.lasting.at_s <= time_s < change.lasting.until_s}
    return tuple(sorted(due.values()))


def compare_faces(lasting: Lasting, about: str, before: Sequence[Face], after: Sequence[Face]) -> Change:
    """The change from some faces to others."""
    known = {face.name: face for face in before}
    kept = {face.name for face in after if face.name in known and _is_same(face, known[face.name])}
    return Change(lasting, about, frozenset(known.keys() - kept), tuple(f for f in after if f.name not in kept))


def _is_same(one: Face, other: Face) -> bool:
    sides = ((one.front, other.front), (one.back, other.back))
    return all(len(a) == len(b) for a, b in sides) and all(
        x.colour == y.colour and np.array_equal(x.polygon_world, y.polygon_world)
        for a, b in sides for x, y in zip(a, b, strict=True))
