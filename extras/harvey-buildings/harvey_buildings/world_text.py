"""The text of a world file from a layout, for people to read and change."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator

import numpy as np

from harvey_buildings.fitting.building_plan import Furnishing, Space, Storey, Window
from harvey_buildings.fitting.layout import LINTEL_M, Layout
from harvey_buildings.fitting.placement import PlacedOpening, PlacedWindow
from harvey_buildings.fitting.polygons import Floats, find_center

HEAD = """\
[finishes]   # none of these is in the building file
plaster = { colour = [0.80, 0.77, 0.68], texture = "speckle", scale = 0.08 }
carpet = { colour = [0.42, 0.40, 0.38], texture = "carpet", scale = 0.03 }
white = { colour = [0.90, 0.90, 0.88] }
skirting = { colour = [0.25, 0.18, 0.14] }
oak = { colour = [0.55, 0.38, 0.22], texture = "wood", scale = 0.1 }
walnut = { colour = [0.30, 0.19, 0.12] }
steel = { colour = [0.52, 0.55, 0.57] }
glass = { colour = [0.72, 0.84, 0.93] }

[defaults]
walls = "plaster"
floor = "carpet"
ceiling = "white"
baseboard = "skirting"
frame = "walnut"
leaf = "oak"
threshold = "steel"
"""


def world_text(layout: Layout) -> str:
    """The TOML text of a world."""
    plan = layout.plan
    lines = [f"# Made from {_plain(plan.source)} by harvey world import. Metres; each room's origin is the south-west "
             "corner of its bounds.",
             f"name = {_text(plan.name)}", 'units = "metres"',
             f"sigma_cm = {_n(100.0 * plan.sigma_m)}   # how well such a file knows its places; 1 if measured",
             "", HEAD]
    for storey in plan.storeys:
        if storey.name in layout.north_m:
            lines += _storey(storey, layout.north_m[storey.name])
    for name in layout.rooms:
        lines += _room(layout, plan.space(name))
    lines += ["[doors]", *(_door(layout, cut) for cut in layout.cuts), ""]
    if plan.links:
        lines += ["[links]   # between rooms that share no wall; x, y, heading in degrees of the stops in both"]
        lines += [_link(layout, way.name, way.kind, way.between) for way in plan.links]
    return "\n".join(lines).rstrip() + "\n"


def corner(outline: Floats) -> Floats:
    """(2,) origin of a room's own coordinate frame on the plan of its storey [m]."""
    return np.asarray(outline.min(axis=0))


def _storey(storey: Storey, north_m: float) -> list[str]:
    return [f"[locales.{_text(storey.name)}]", 'kind = "floor"', f"at = [0, {_n(north_m)}]",
            f"properties = {{ elevation_m = {_n(storey.elevation_m)} }}", ""]


def _room(layout: Layout, space: Space) -> list[str]:
    outline = layout.rooms[space.name]
    own = outline - corner(outline)
    facts = {"label": space.label, "unreachable": layout.shut_off.get(space.name, ""),
             "full": "no place for a robot" if space.name in layout.full else ""}
    lines = [f"[locales.{_text(space.name)}]", f"kind = {_text(space.kind)}", f"in = {_text(space.storey)}",
             f"at = [{_row(corner(outline))}]", f"height = {_n(space.height_m)}",
             f"outline = [{', '.join(f'[{_row(p)}]' for p in own)}]",
             "properties = { " + ", ".join(f"{key} = {_text(value)}" for key, value in facts.items() if value) + " }"]
    things = list(_things(layout, space, outline))
    if things:
        lines += ["things = [", *(f"  {thing}," for thing in things), "]"]
    return [*lines, ""]


def _things(layout: Layout, space: Space, outline: Floats) -> Iterator[str]:
    taken: set[str] = set()
    for pane, window in layout.panes:
        if pane.room == space.name:
            yield _pane(pane, window, space, _make_unique(window.name, taken))
    for thing in layout.furnishings.get(space.name, ()):
        yield _thing(thing, corner(outline), _make_unique(thing.name, taken))


def _make_unique(name: str, taken: set[str]) -> str:
    """The name, with the first free number from 2 on where it is taken."""
    unique, number = name, 1
    while unique in taken:
        number += 1
        unique = f"{name}-{number}"
    taken.add(unique)
    return unique


def _pane(pane: PlacedWindow, window: Window, space: Space, name: str) -> str:
    sill = max(0.0, window.sill_m - space.floor_m)
    top = min(window.sill_m + window.height_m - space.floor_m, space.height_m - LINTEL_M)
    box = _box((-pane.width_m / 2, pane.width_m / 2, 0.0, 0.05, 0.0, top - sill))
    rim = ', rim = "walnut", rim_width = 0.06' if min(pane.width_m, top - sill) > 0.2 else ""
    return (f'{{ name = {_text(name)}, wall = "side-{pane.side}", along = {_n(pane.along_m)}, up = {_n(sill)}, '
            f'boxes = [{{ {box}, finish = "glass"{rim} }}] }}')


def _thing(thing: Furnishing, origin: Floats, name: str) -> str:
    finish = "steel" if thing.kind == "stairs" else "oak"
    boxes = ", ".join(f"{{ {_box(box)} }}" for box in thing.boxes)
    return (f"{{ name = {_text(name)}, at = [{_row(thing.at - origin)}], turn = {_n(math.degrees(thing.turn_rad))}, "
            f"finish = {_text(finish)}, boxes = [{boxes}] }}")


def _box(box: tuple[float, ...]) -> str:
    return ", ".join(f"{axis} = [{_row(box[2 * i : 2 * i + 2])}]" for i, axis in enumerate("xyz"))


def _door(layout: Layout, cut: PlacedOpening) -> str:
    names = ", ".join(_text(name) for name in cut.between)
    shown = ", open = true" if cut.is_open else ""
    return (f'{_text(cut.name)} = {{ between = [{names}], wall = "side-{cut.side}", along = {_n(cut.along_m)}, '
            f"width = {_n(cut.width_m)}, height = {_n(cut.height_m)}{shown} }}")


def _link(layout: Layout, name: str, kind: str, between: tuple[str, str]) -> str:
    stops = []
    for room in between:
        outline = layout.rooms[room]
        stops.append(f"[{_row(find_center(outline, []) - corner(outline))}, 0]")
    names = ", ".join(_text(room) for room in between)
    return f"{_text(name)} = {{ kind = {_text(kind)}, between = [{names}], stops = [{', '.join(stops)}] }}"


def _plain(text: str) -> str:
    return "".join(letter for letter in text if letter.isprintable())


def _text(text: str) -> str:
    """A TOML string; JSON's strings are such."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007F")


def _row(values: Iterable[float]) -> str:
    return ", ".join(_n(float(value)) for value in values)


def _n(value: float) -> str:
    """A number to a tenth of a millimetre."""
    return f"{round(value, 4) + 0.0:.4f}".rstrip("0").rstrip(".") or "0"
