"""Landmarks: things with edges that a camera can find again, as model lines and corner points."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from world_models.frames import frozen

CONTOUR_CONTRAST = 0.25
"""Contrast expected at an occluding contour before an unknown background, 0..1."""


@dataclass(frozen=True, eq=False)
class Edges:
    """Model lines with the surfaces on both sides of each, from which its visibility and contrast follow.

    Attributes:
        lines_world: (n, 2, 3) [m].
        normals_world: (n, 2, 3) unit normals of the two surfaces that meet in the line. Where one surface only
            carries the other (a floor under a box), the other's normal is given twice: the line shows when that one
            does.
        brightness: (n, 3) expected, 0..1, of the two surfaces and of the background behind the line when only one of
            them faces the camera (NaN: unknown).
    """

    lines_world: NDArray[np.float64]
    normals_world: NDArray[np.float64]
    brightness: NDArray[np.float64]

    def __post_init__(self) -> None:
        object.__setattr__(self, "lines_world", frozen(self.lines_world, (None, 2, 3)))
        object.__setattr__(self, "normals_world", frozen(self.normals_world, (None, 2, 3)))
        object.__setattr__(self, "brightness", frozen(self.brightness, (None, 3)))

    def __len__(self) -> int:
        return len(self.lines_world)

    @staticmethod
    def from_rows(edges: Iterable[tuple[Any, Any, Any]]) -> Edges:
        """From (line (2, 3), normals (2, 3), brightness (3,)) triples."""
        rows = list(edges)
        return Edges(
            np.array([line for line, _, _ in rows], float).reshape(-1, 2, 3),
            np.array([normals for _, normals, _ in rows], float).reshape(-1, 2, 3),
            np.array([brightness for _, _, brightness in rows], float).reshape(-1, 3),
        )

    @staticmethod
    def concatenate(parts: Iterable[Edges]) -> Edges:
        """All edges of several sets, in order."""
        several = [Edges.from_rows(()), *parts]
        return Edges(*(np.concatenate([getattr(e, name) for e in several])
                       for name in ("lines_world", "normals_world", "brightness")))

    def contrasts(self, centre_world: Any) -> NDArray[np.float64]:
        """(n,) brightness step, 0..1, across each line as seen from a point (3,); 0 where the line does not show.

        Where a colour is unknown, a middling one.
        """
        towards = np.asarray(centre_world, float) - self.lines_world[:, 0]
        facing = np.einsum("nij,nj->ni", self.normals_world, towards) > 1e-6
        crease = np.abs(self.brightness[:, 0] - self.brightness[:, 1])
        crease = np.where(np.isnan(crease), CONTOUR_CONTRAST, crease)
        seen = np.where(facing[:, 0], self.brightness[:, 0], self.brightness[:, 1])
        behind = np.abs(seen - self.brightness[:, 2])
        contour = np.where(np.isnan(behind), CONTOUR_CONTRAST, behind)
        return np.where(facing.all(axis=1), crease, np.where(facing.any(axis=1), contour, 0.0))


@dataclass(frozen=True, eq=False)
class Landmark:
    """A thing with edges: a door's casing, a piece of furniture, the trim of a wall.

    Attributes:
        name: unique in the world.
        locale: where it stands.
        kind: door, doorway, wall, or the part that it is made from.
        edges: its model lines.
        neighbour: the second locale from which it is seen, for an open door's casing.
        source: file:line of its description.
    """

    name: str
    locale: str
    kind: str
    edges: Edges = field(default_factory=lambda: Edges.from_rows(()))
    neighbour: str | None = None
    source: str = ""

    @property
    def lines_world(self) -> NDArray[np.float64]:
        """(n, 2, 3) model lines [m]."""
        return self.edges.lines_world

    @cached_property
    def points_world(self) -> NDArray[np.float64]:
        """(m, 3) corners: ends of model lines in which at least two lines meet [m]."""
        ends = self.lines_world.reshape(-1, 3)
        _, first, count = np.unique(np.round(ends, 5), axis=0, return_index=True, return_counts=True)
        return frozen(ends[np.sort(first[count >= 2])].reshape(-1, 3))

    def corner_lines(self) -> list[NDArray[np.int64]]:
        """Of each corner (k,) indices of the model lines that end in it."""
        off = self.lines_world - self.points_world[:, None, None]
        return [np.flatnonzero(near) for near in np.linalg.norm(off, axis=3).min(axis=2) < 1e-4]
