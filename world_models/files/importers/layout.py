"""From what was found in a building file to rooms with walls, openings cut and everything in its place."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import networkx as nx
import numpy as np
import shapely

from world_models.files.importers.curves import straight_at
from world_models.files.importers.cuts import (
    Cut,
    Pane,
    all_pairs,
    door_between,
    door_outside,
    doorway,
    overlap,
    panes,
    wide_opening,
)
from world_models.files.importers.outlines import THICKEST_M, THIN_WALL_M, Floats, apart, facing
from world_models.files.importers.plan import BuildingError, Furnishing, Gap, Plan, Space, Window
from world_models.files.importers.things import HIGH_M, footprint, in_the_way, lowest_m, put_inside

APART_M = 10.0
"""Between storeys laid out beside each other."""
HEADER_M = 0.2
"""Wall above an opening, at the least."""
LARGEST_M = 2000.0
ROBOT_M = 0.36
"""Radius of a robot that should find a place in a room."""
FAR_M = 2.0
MEETING_M = 2.5 * THIN_WALL_M
"""Spaces that are no further apart, once thin walls are between all that touch, meet."""
THICK_M = 0.89
"""Of the walls of old houses, as a world may have them: rooms that a door joins, where none are nearer."""
IN_DOORWAY_M = 0.05
STEP_M = 0.05


@dataclass
class Layout:
    """A building ready to be written as a world: everything of :class:`Plan`, in its final place.

    Attributes:
        plan: what was found.
        rooms: name of each room and its outline on the plan [m], in the order of the world.
        north_m: how far each storey is moved north, since storeys would lie over one another on a plan.
        cuts, panes: openings and windows in the walls.
        furnishings: by room.
        shut_off: rooms that no open way joins to the first, and why.
        full: rooms with no place where a robot of ROBOT_M would stand free.
    """

    plan: Plan
    rooms: dict[str, Floats] = field(default_factory=dict)
    north_m: dict[str, float] = field(default_factory=dict)
    cuts: list[Cut] = field(default_factory=list)
    panes: list[tuple[Pane, Window]] = field(default_factory=list)
    furnishings: dict[str, list[Furnishing]] = field(default_factory=dict)
    shut_off: dict[str, str] = field(default_factory=dict)
    full: set[str] = field(default_factory=set)


def lay_out(plan: Plan) -> Layout:
    """Raises BuildingError where there is no room in it."""
    layout = Layout(plan)
    for storey in plan.storeys:
        _raise_walls(layout, storey.name)
        _straighten(layout, storey.name)
    _furnish(layout)
    for storey in plan.storeys:
        _cut(layout, storey.name)
        _glaze(layout, storey.name)
    _clear_doorways(layout)
    _tell_steps(layout)
    if not layout.rooms:
        raise BuildingError(f"{plan.source}: expected spaces with a floor, got none that can be used")
    plan.ways = [way for way in plan.ways if all(room in layout.rooms for room in way.between)]
    _spread(layout)
    _order(layout)
    _fill(layout)
    return layout


def _raise_walls(layout: Layout, storey: str) -> None:
    plan, account = layout.plan, layout.plan.account
    wanted = {space.name: space.outline for space in plan.on(storey)}
    rooms, changed = apart(wanted)
    layout.rooms.update(rooms)
    for name in wanted:
        if name not in rooms:
            account.left_out.append(f"space {name}: other spaces of {storey} cover it")
    if changed:
        account.guessed.append(f"{storey}: {len(changed)} spaces touch without a wall between them; a wall of "
                               f"{100 * THIN_WALL_M:.0f} cm was put there ({', '.join(changed)})")


def _outlines(layout: Layout, storey: str) -> dict[str, Floats]:
    return {space.name: layout.rooms[space.name] for space in layout.plan.on(storey) if space.name in layout.rooms}


def _near(gap: Gap, outlines: Mapping[str, Floats]) -> dict[str, Floats]:
    """The rooms whose bounds are next to a door: in a large building not every pair of rooms is looked at."""
    return {name: outline for name, outline in outlines.items()
            if (outline.min(axis=0) < gap.centre + FAR_M).all() and (outline.max(axis=0) > gap.centre - FAR_M).all()}


def _straighten(layout: Layout, storey: str) -> None:
    """Curved walls get a straight side for each of their doors."""
    outlines = _outlines(layout, storey)
    for gap in (gap for gap in layout.plan.gaps if gap.storey == storey and gap.along is not None):
        near = _near(gap, outlines)
        if gap.along is None or door_between(gap, near, all_pairs(near), THICK_M):
            continue
        for name in near:
            changed = straight_at(near[name], gap.centre, gap.along, gap.width_m)
            if changed is not None:
                layout.rooms[name] = outlines[name] = changed
                layout.plan.account.guessed.append(f"space {name}: its curved wall is straight at {gap.name}")


def _cut(layout: Layout, storey: str) -> None:
    """Doors first, then wide openings where there is no wall."""
    plan, account = layout.plan, layout.plan.account
    outlines = _outlines(layout, storey)
    for gap in (gap for gap in plan.gaps if gap.storey == storey):
        cut = _door(layout, gap, _near(gap, outlines))
        if cut is not None and overlap(cut, layout.cuts, layout.rooms):
            if gap.has_leaf:
                account.left_out.append(f"door {gap.name}: another door is in its place")
        elif cut is not None:
            layout.cuts.append(cut)
    for a, b in all_pairs(outlines):
        if frozenset((a, b)) in plan.without_wall:
            _open_up(layout, a, b, outlines)


def _door(layout: Layout, gap: Gap, outlines: Mapping[str, Floats]) -> Cut | None:
    account = layout.plan.account
    known = tuple(room for room in gap.rooms if room in outlines)
    found = None
    for thickest_m in (THICKEST_M, THICK_M):
        if found is None and len(known) == 2:
            found = door_between(gap, outlines, [(known[0], known[1])], thickest_m)
        if found is None:
            found = door_between(gap, outlines, all_pairs(outlines), thickest_m)
            if found is not None and known and not set(known) <= set(found[0].between):
                found = None
    if found is not None:
        cut, change = found
        low = min(layout.plan.space(room).height_m for room in cut.between)
        if change > 0.01:
            account.guessed.append(f"door {gap.name}: moved or narrowed by {100 * change:.0f} cm to fit its wall")
        return _under(cut, low)
    if not gap.has_leaf:
        account.left_out.append(f"{gap.name}: an opening, but not between two spaces of one storey")
        return None
    out = door_outside(gap, {room: outlines[room] for room in known} or outlines)
    if out is None:
        joined = f" of {' and '.join(known)}" if known else ""
        account.left_out.append(f"door {gap.name}: no wall{joined} where it should be")
        return None
    account.guessed.append(f"door {gap.name}: leads out of {out.between[0]} to no space of the file; drawn closed")
    return _under(out, layout.plan.space(out.between[0]).height_m)


def _under(cut: Cut, ceiling_m: float) -> Cut:
    """The same opening, no higher than a room has wall for."""
    height = min(cut.height_m, ceiling_m - HEADER_M)
    return Cut(cut.name, cut.between, cut.side, round(cut.along_m, 4), round(cut.width_m, 4), round(height, 4),
               cut.is_open)


def _open_up(layout: Layout, a: str, b: str, outlines: Mapping[str, Floats]) -> None:
    plan, account = layout.plan, layout.plan.account
    own = [cut for cut in layout.cuts if {a, b} & set(cut.between)]
    height = min(plan.space(room).height_m for room in (a, b)) - HEADER_M
    solid = [footprint(thing) for room in (a, b) for thing in layout.furnishings.get(room, ()) if in_the_way(thing)]
    barriers = plan.barriers.get(plan.space(a).storey, ())
    cut = wide_opening(f"{a}-to-{b}", a, b, outlines, height, own, MEETING_M, solid, barriers)
    if cut is None or overlap(cut, layout.cuts, layout.rooms):
        account.left_out.append(f"{a} and {b} meet without a wall, but not along a line with room for an opening")
        return
    layout.cuts.append(_under(cut, height + HEADER_M))
    account.guessed.append(f"{a} to {b}: no wall between them in the file; an opening {cut.width_m:.2f} m wide, "
                           "where no furniture stands in the way")


def _glaze(layout: Layout, storey: str) -> None:
    plan, account = layout.plan, layout.plan.account
    outlines = _outlines(layout, storey)
    for window in (w for w in plan.windows if w.storey == storey):
        found = [(pane, window) for pane in panes(window, outlines)]
        layout.panes += found
        if not found:
            account.left_out.append(f"window {window.name}: no wall of a space runs along it")


def _furnish(layout: Layout) -> None:
    account = layout.plan.account
    for thing in layout.plan.furnishings:
        if thing.room not in layout.rooms:
            account.left_out.append(f"{thing.name}: its space is not there")
            continue
        placed = put_inside(thing, layout.rooms[thing.room], layout.plan.space(thing.room))
        if placed is None:
            account.left_out.append(f"{thing.name}: does not fit into {thing.room}")
        else:
            layout.furnishings.setdefault(thing.room, []).append(placed)


def _clear_doorways(layout: Layout) -> None:
    """What would stand in an open doorway is left out: a file may have a mat, or a door's own handle, as furniture."""
    for cut in (cut for cut in layout.cuts if cut.is_open):
        floor = shapely.Polygon(doorway(cut, layout.rooms, IN_DOORWAY_M))
        for room in cut.between:
            for thing in list(layout.furnishings.get(room, ())):
                if lowest_m(thing) < cut.height_m and shapely.Polygon(footprint(thing)).intersection(floor).area > 1e-4:
                    layout.furnishings[room].remove(thing)
                    layout.plan.account.left_out.append(f"{thing.name}: it stands in the doorway {cut.name}")


def _tell_steps(layout: Layout) -> None:
    """A storey is level here: what a file has as a step, or a ramp, between two of its rooms is said."""
    for cut in (cut for cut in layout.cuts if cut.is_open):
        floors = [layout.plan.space(room).floor_m for room in cut.between]
        if abs(floors[0] - floors[1]) > STEP_M:
            layout.plan.account.guessed.append(f"{cut.name}: from {cut.between[0]} to {cut.between[1]} the floor goes "
                                               f"{'down' if floors[1] < floors[0] else 'up'} by "
                                               f"{abs(floors[0] - floors[1]):.2f} m in the file; drawn level")


def _spread(layout: Layout) -> None:
    """Storeys side by side, the lowest where it is, the others north of it."""
    used = [s for s in layout.plan.storeys if any(space.name in layout.rooms for space in layout.plan.on(s.name))]
    top = None
    for storey in used:
        points = np.concatenate([layout.rooms[s.name] for s in layout.plan.on(storey.name) if s.name in layout.rooms])
        low, high = float(points[:, 1].min()), float(points[:, 1].max())
        move = 0.0 if top is None else float(np.ceil(top + APART_M - low))
        layout.north_m[storey.name] = move
        top = high + move
        if abs(top) > LARGEST_M or np.abs(points).max() > LARGEST_M:
            raise BuildingError(f"{layout.plan.source}: expected a building within {LARGEST_M:.0f} m of its origin, "
                                f"got a storey {storey.name} that reaches beyond")
    if len(used) > 1:
        layout.plan.account.guessed.append(
            f"storeys lie over one another: on the plan they are {APART_M:.0f} m or more apart, each moved north "
            f"({', '.join(f'{s} by {m:g} m' for s, m in layout.north_m.items())}); their height is a property")


def _order(layout: Layout) -> None:
    """The rooms that most others can be reached from come first; those that cannot be reached from there say why."""
    graph = nx.Graph()
    graph.add_nodes_from(layout.rooms)
    graph.add_edges_from(cut.between for cut in layout.cuts if len(cut.between) == 2)
    graph.add_edges_from(way.between for way in layout.plan.ways)
    order = {name: index for index, name in enumerate(layout.rooms)}
    parts = sorted(nx.connected_components(graph), key=lambda part: (-len(part), min(order[name] for name in part)))
    layout.rooms = {name: layout.rooms[name] for part in parts for name in sorted(part, key=order.__getitem__)}
    for part in parts[1:]:
        for name in sorted(part, key=order.__getitem__):
            why = _why_shut_off(layout, name, part, next(iter(layout.rooms)))
            layout.shut_off[name] = why
    for part in parts[1:]:
        names = sorted(part, key=order.__getitem__)
        layout.plan.account.left_out.append(f"a way to {', '.join(names)}: {layout.shut_off[names[0]]}")


def _why_shut_off(layout: Layout, name: str, part: set[str], first: str) -> str:
    doors = [cut.name for cut in layout.cuts if len(cut.between) == 1 and cut.between[0] in part]
    if doors:
        return f"from {first} only out of doors, by {', '.join(doors)}, and the file has no space there"
    return "the file has no door, opening or stairs that lead there"


def _fill(layout: Layout) -> None:
    """Which rooms are too small or too full for a robot."""
    for name, outline in layout.rooms.items():
        solid = [shapely.Polygon(footprint(thing)).buffer(ROBOT_M) for thing in layout.furnishings.get(name, ())
                 if lowest_m(thing) < HIGH_M]
        if shapely.Polygon(outline).buffer(-ROBOT_M).difference(shapely.union_all(solid)).is_empty:
            layout.full.add(name)
    if layout.full:
        layout.plan.account.left_out.append(f"no place for a robot of {ROBOT_M} m radius (said as a property): "
                                            f"{', '.join(n for n in layout.rooms if n in layout.full)}")


def neighbours_without_wall(spaces: Sequence[Space], which: set[str],
                            barriers: Sequence[shapely.Geometry] = ()) -> set[frozenset[str]]:
    """Pairs of these spaces of one storey that touch along a line, of which both are among ``which``.

    Where there are barriers, only those between which they leave room for a wide opening.
    """
    kept, _ = apart({space.name: space.outline for space in spaces if space.name in which})
    pairs = [(a, b) for a, b in all_pairs(kept) if any(s.gap_m < MEETING_M for s in facing(a, kept[a], b, kept[b]))]
    return {frozenset((a, b)) for a, b in pairs
            if not barriers or wide_opening("", a, b, kept, 1.0, (), MEETING_M, (), barriers) is not None}
