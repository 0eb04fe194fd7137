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
"""Contrast expected where a thing's outline stands before something unknown."""


@dataclass(frozen=True, eq=False)
class Edges:
    """Model lines with what lies on their two sides, from which follows when they show.

    Attributes:
        lines_world: (n, 2, 3) [m].
        normals_world: (n, 2, 3) unit normals of the two surfaces that meet in the line. Where one of them is only the
            ground that the other stands on, that other's normal is given twice: the line shows when that one does.
        levels: (n, 3) brightness, 0..1, of the two surfaces and of what is seen behind the line when only one of them
            faces the camera (NaN: unknown).
    """

    lines_world: NDArray[np.float64]
    normals_world: NDArray[np.float64]
    levels: NDArray[np.float64]

    def __post_init__(self) -> None:
        object.__setattr__(self, "lines_world", frozen(self.lines_world, (None, 2, 3)))
        object.__setattr__(self, "normals_world", frozen(self.normals_world, (None, 2, 3)))
        object.__setattr__(self, "levels", frozen(self.levels, (None, 3)))

    def __len__(self) -> int:
        return len(self.lines_world)

    @staticmethod
    def of(edges: Iterable[tuple[Any, Any, Any]]) -> Edges:
        """From (line (2, 3), normals (2, 3), levels (3,)) triples."""
        rows = list(edges)
        return Edges(
            np.array([line for line, _, _ in rows], float).reshape(-1, 2, 3),
            np.array([normals for _, normals, _ in rows], float).reshape(-1, 2, 3),
            np.array([levels for _, _, levels in rows], float).reshape(-1, 3),
        )

    @staticmethod
    def joined(parts: Iterable[Edges]) -> Edges:
        """All of them, one after the other."""
        several = [Edges.of(()), *parts]
        return Edges(*(np.concatenate([getattr(e, name) for e in several])
                       for name in ("lines_world", "normals_world", "levels")))

    def contrasts(self, centre_world: Any) -> NDArray[np.float64]:
        """(n,) brightness step across each line as seen from a point (3,); 0 where it does not show."""
        towards = np.asarray(centre_world, float) - self.lines_world[:, 0]
        facing = np.einsum("nij,nj->ni", self.normals_world, towards) > 1e-6
        crease = np.abs(self.levels[:, 0] - self.levels[:, 1])
        seen = np.where(facing[:, 0], self.levels[:, 0], self.levels[:, 1])
        behind = np.abs(seen - self.levels[:, 2])
        contour = np.where(np.isnan(behind), CONTOUR_CONTRAST, behind)
        return np.where(facing.all(axis=1), crease, np.where(facing.any(axis=1), contour, 0.0))


@dataclass(frozen=True, eq=False)
class Landmark:
    """A thing with edges: a door frame, a piece of furniture, the trim of a wall.

    Attributes:
        name: unique in the world.
        locale: where it stands.
        kind: door, wall, or the part that it is made from.
        edges: its model lines.
        neighbour: the second locale from which it is seen, for a door frame.
        source: file:line where it is described.
    """

    name: str
    locale: str
    kind: str
    edges: Edges = field(default_factory=lambda: Edges.of(()))
    neighbour: str | None = None
    source: str = ""

    @property
    def lines_world(self) -> NDArray[np.float64]:
        """(n, 2, 3) its model lines [m]."""
        return self.edges.lines_world

    @cached_property
    def points_world(self) -> NDArray[np.float64]:
        """(m, 3) its corners: ends of model lines in which at least two lines meet [m]."""
        ends = self.lines_world.reshape(-1, 3)
        _, first, count = np.unique(np.round(ends, 5), axis=0, return_index=True, return_counts=True)
        return frozen(ends[np.sort(first[count >= 2])].reshape(-1, 3))

    def corner_lines(self, point: int) -> NDArray[np.int64]:
        """(k,) which model lines end in corner number ``point``."""
        near = np.linalg.norm(self.lines_world - self.points_world[point], axis=2).min(axis=1) < 1e-4
        return np.flatnonzero(near)
