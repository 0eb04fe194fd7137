"""The plan of a report: each storey that the robot was on, with the believed and the true path, and marks to move."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

from world_models.building.plan_view import SCALE, Storey, draw_storeys, drawing_svg
from world_models.building.world import World

MARKS = """\
<g class="true mark" hidden="hidden"><path d="M 16 0 L -10 9 L -10 -9 Z"/></g>
<g class="believed mark" hidden="hidden"><ellipse rx="1" ry="1"/><path d="M 16 0 L -10 9 L -10 -9 Z"/></g>
<g class="candidates"></g>"""


def draw_plans(
    world: World, beliefs: Sequence[Mapping[str, Any]], track: Sequence[tuple[int, float, float, float]]
) -> list[dict[str, Any]]:
    """A drawing for each storey on which it believed to be; where it truly was is drawn where it believed to be.

    Args:
        track: (cycle, x [m], y [m], heading [rad]) of the true poses; empty where nobody knows them.

    Returns:
        svg, rooms; scale [units a metre], left and top: the drawing's (x, y) of a point (x, y) of the world is
        scale * (x - left), scale * (top - y).
    """
    been = {belief["locale"] for belief in beliefs}
    storeys = [storey for storey in draw_storeys(world) if been & set(storey.rooms)]
    return [_draw(storey, beliefs, track) for storey in storeys]


def draw_blank_plans(world: World) -> list[dict[str, Any]]:
    """A drawing for every storey, as by :func:`draw_plans`, without paths."""
    return [_draw(storey, (), ()) for storey in draw_storeys(world)]


def _draw(
    storey: Storey, beliefs: Sequence[Mapping[str, Any]], track: Sequence[tuple[int, float, float, float]]
) -> dict[str, Any]:
    left, top = float(storey.origin[0]), float(storey.origin[1] + storey.drawing.size[1])

    def line(points: Sequence[tuple[float, float]], kind: str) -> str:
        drawn = " ".join(f"{SCALE * (x - left):.1f},{SCALE * (top - y):.1f}" for x, y in points)
        return f'<polyline class="{kind} path" points="{drawn}"/>'

    here = [(one["cycle"], one["x"], one["y"], one["locale"] in storey.rooms) for one in beliefs]
    believed = [[(x, y) for _, x, y, _ in run] for inside, run in groupby(here, key=lambda one: one[3]) if inside]
    true = [(x, y) for cycle, x, y, _ in track if _is_here(here, cycle)]
    more = "\n".join([*([line(true, "true")] if true else []), *(line(one, "believed") for one in believed), MARKS])
    return {"svg": drawing_svg(storey.drawing, more), "rooms": list(storey.rooms), "scale": SCALE, "left": left,
            "top": top}


def _is_here(here: Sequence[tuple[int, float, float, bool]], cycle: int) -> bool:
    """Whether the belief of a cycle is on the storey."""
    before = bisect_right(here, cycle, key=lambda one: one[0])
    return bool(here) and here[max(0, before - 1)][3]
