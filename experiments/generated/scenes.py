"""A scene of a few patches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

UNIFORM_SCALE_M = 1e6
"""Texture scale at which a plain surface has one colour."""
WHITE, BLACK, WALL = (0.75, 0.75, 0.75), (0.05, 0.05, 0.05), (0.4, 0.4, 0.4)


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


def build_print(is_black: Any, pixel_m: float, margin_px: int) -> tuple[PatchFace, PatchFace]:
    """A wall, and before it a sheet with a print (h, w), in the print's frame. It is seen from z < 0."""

    def rectangle(x0: float, y0: float, x1: float, y1: float) -> Any:
        return pixel_m * np.array([(x0, y0, 0.0), (x0, y1, 0.0), (x1, y1, 0.0), (x1, y0, 0.0)])

    high, wide = is_black.shape
    sheet = rectangle(-margin_px, -margin_px, wide + margin_px, high + margin_px)
    paper = Patch("paper", sheet, WHITE, "plain", UNIFORM_SCALE_M)
    black = [Patch(f"{number}", rectangle(*block), BLACK, "plain", UNIFORM_SCALE_M)
             for number, block in enumerate(_find_blocks(is_black))]
    far_m = [(-40.0, -40.0, 9.0), (-40.0, 40.0, 9.0), (40.0, 40.0, 9.0), (40.0, -40.0, 9.0)]
    return PatchFace((Patch("wall", far_m, WALL, "plain", UNIFORM_SCALE_M),)), PatchFace((paper, *black))


def _find_blocks(is_black: Any) -> list[tuple[int, int, int, int]]:
    """Rectangles (left, top, right, bottom) that make up what is black: a run of a row, with the same below it."""
    blocks: list[tuple[int, int, int, int]] = []
    began = dict[tuple[int, int], int]()
    for y, row in enumerate([*is_black, np.zeros_like(is_black[0])]):
        edges = np.flatnonzero(np.diff(row.astype(int), prepend=0, append=0)).tolist()
        runs = set(zip(edges[::2], edges[1::2], strict=True))
        blocks += [(left, began.pop((left, right)), right, y) for left, right in began.keys() - runs]
        began |= dict.fromkeys(runs - began.keys(), y)
    return blocks
