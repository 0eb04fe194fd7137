"""A scene of a few patches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, eq=False)
class Patch:
    """A region of a face: a flat convex polygon (k, 3) [m], colour and texture."""

    name: str
    polygon_world: Any
    colour: tuple[float, float, float] = (0.7, 0.7, 0.7)
    texture: str = "plain"
    texture_scale_m: float = 0.1
    seed: int = 0


@dataclass(frozen=True, eq=False)
class PatchFace:
    """A face with regions on its two sides."""

    front: tuple[Patch, ...]
    back: tuple[Patch, ...] = ()
