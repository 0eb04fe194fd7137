"""From a building plan to a layout: rooms with walls, openings, windows and furniture in place."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import networkx as nx
import numpy as np
import shapely

from harvey_buildings.fitting.building_plan import (
    BuildingError,
    BuildingPlan,
    Furnishing,
    Space,
    WallOpening,
    Window,
)
from harvey_buildings.fitting.placement import (
    ROBOT_TOP_M,
    PlacedOpening,
    PlacedWindow,
    all_pairs,
    bottom_m,
    doorway,
    find_panes,
    fit_into_room,
    footprint,
    is_obstacle,
    overlap,
    place_door,
    place_outer_door,
    place_wide_opening,
)
from harvey_buildings.fitting.polygons import (
    MAX_WALL_M,
    THIN_WALL_M,
    Floats,
    find_facing_stretches,
    separate_outlines,
    straighten_wall,
)
from world_models.building.checks import Watched, pass_on
from world_models.files.construction.specs import DOOR_SIZES_M

STOREY_GAP_M = 10.0
"""Distance between storeys that are laid out side by side."""
HEADER_M = 0.2
"""Least height of wall above an opening."""
MAX_EXTENT_M = 2000.0
ROBOT_RADIUS_M = 0.36
"""A room is full where no point has this clearance."""
DOOR_REACH_M = 2.0
"""Rooms whose bounds are further from a door are not looked at."""
MAX_MEETING_GAP_M = 2.5 * THIN_WALL_M
"""Spaces no further apart, after thin walls were put between touching ones, meet."""
MAX_OLD_WALL_M = 0.89
"""Thickness of the walls of old houses: tried for a door where no thinner wall fits."""
DOORWAY_CLEARANCE_M = 0.05
MIN_OPENING_M, MAX_OPENING_M = DOOR_SIZES_M
MAX_STEP_M = 0.05
LINTEL_M, MIN_PANE_M = 0.1, 0.02
"""Wall above a window, and its least height."""


@dataclass
class Layout:
    """A building ready to be written as a world file.

    Attributes:
        plan: the contents of the building file.
        rooms: outline of each room on the plan (k, 2) [m], by name, in the order of the world.
        north_m: how far each storey is moved north, so that storeys do not lie over one another on the plan.
        cuts, panes: openings and windows in the walls.
        furnishings: by room.
        shut_off: rooms without an open way to the first room, and why.
        full: rooms with no free place for a robot of ROBOT_RADIUS_M.
    """

    plan: BuildingPlan
    rooms: dict[str, Floats] = field(default_factory=dict)
    north_m: dict[str, float] = field(default_factory=dict)
    cuts: list[PlacedOpening] = field(default_factory=list)
    panes: list[tuple[PlacedWindow, Window]] = field(default_factory=list)
    furnishings: dict[str, list[Furnishing]] = field(default_factory=dict)
    shut_off: dict[str, str] = field(default_factory=dict)
    full: set[str] = field(default_factory=set)


def lay_out(plan: BuildingPlan, watched: Watched = pass_on) -> Layout:
    """The layout of a building plan. Raises BuildingError where it has no room."""
    layout = Layout(plan)
    for storey in plan.storeys:
        _separate_rooms(layout, storey.name, watched)
        _straighten_walls(layout, storey.name)
    _place_furniture(layout)
    for storey in plan.storeys:
        _place_openings(layout, storey.name, watched)
        _place_windows(layout, storey.name)
    _clear_doorways(layout)
    _report_steps(layout)
    if not layout.rooms:
        raise BuildingError(f"{plan.source}: expected spaces with a floor, got none that can be used")
    plan.links = [way for way in plan.links if all(room in layout.rooms for room in way.between)]
    _spread_storeys(layout)
    _order_rooms(layout)
    _mark_full_rooms(layout)
    return layout


def _separate_rooms(layout: Layout, storey: str, watched: Watched) -> None:
    plan, report = layout.plan, layout.plan.report
    wanted = {space.name: space.outline for space in plan.on(storey)}
    rooms, changed = separate_outlines(wanted, watched)
    layout.rooms.update(rooms)
    for name in wanted:
        if name not in rooms:
            report.left_out.append(f"space {name}: other spaces of {storey} cover it")
    if changed:
        report.guessed.append(f"{storey}: {len(changed)} spaces touch without a wall between them; a wall of "
                               f"{100 * THIN_WALL_M:.0f} cm was put there ({', '.join(changed)})")


def _outlines(layout: Layout, storey: str) -> dict[str, Floats]:
    return {space.name: layout.rooms[space.name] for space in layout.plan.on(storey) if space.name in layout.rooms}


def _near(opening: WallOpening, outlines: Mapping[str, Floats]) -> dict[str, Floats]:
    """The rooms whose bounds are near a door, so that in a large building few pairs of rooms are looked at."""
    low, high = opening.centre - DOOR_REACH_M, opening.centre + DOOR_REACH_M
    return {name: outline for name, outline in outlines.items()
            if (outline.min(axis=0) < high).all() and (outline.max(axis=0) > low).all()}


def _straighten_walls(layout: Layout, storey: str) -> None:
    """Give curved walls a straight side at each of their doors."""
    outlines = _outlines(layout, storey)
    for opening in layout.plan.openings:
        if opening.storey != storey or opening.along is None or opening.width_m < MIN_OPENING_M:
            continue
        near = _near(opening, outlines)
        if place_door(opening, near, all_pairs(near), MAX_OLD_WALL_M):
            continue
        for name in near:
            changed = straighten_wall(near[name], opening.centre, opening.along, opening.width_m)
            if changed is not None:
                layout.rooms[name] = outlines[name] = changed
                layout.plan.report.guessed.append(f"space {name}: its curved wall is straight at {opening.name}")


def _place_openings(layout: Layout, storey: str, watched: Watched) -> None:
    """Place doors, then wide openings where there is no wall."""
    plan, report = layout.plan, layout.plan.report
    outlines = _outlines(layout, storey)
    for opening in watched([opening for opening in plan.openings if opening.storey == storey], "openings placed"):
        if opening.width_m < MIN_OPENING_M:
            report.left_out.append(f"{opening.name}: narrower than {100 * MIN_OPENING_M:.0f} cm")
            continue
        if opening.width_m > MAX_OPENING_M:
            report.guessed.append(f"{opening.name}: {opening.width_m:.1f} m wide in the file; its middle "
                                  f"{MAX_OPENING_M:g} m, as no opening of a world is wider")
            opening = replace(opening, width_m=MAX_OPENING_M)
        cut = _door(layout, opening, _near(opening, outlines))
        if cut is not None and overlap(cut, layout.cuts, layout.rooms):
            if opening.has_leaf:
                report.left_out.append(f"door {opening.name}: another door is in its place")
        elif cut is not None:
            layout.cuts.append(cut)
    for a, b in all_pairs(outlines) if plan.without_wall else ():
        if frozenset((a, b)) in plan.without_wall:
            _place_wide_opening(layout, a, b, outlines)


def _door(layout: Layout, opening: WallOpening, outlines: Mapping[str, Floats]) -> PlacedOpening | None:
    report = layout.plan.report
    known = tuple(room for room in opening.rooms if room in outlines)
    found = None
    for max_wall_m in (MAX_WALL_M, MAX_OLD_WALL_M):
        if found is None and len(known) == 2:
            found = place_door(opening, outlines, [(known[0], known[1])], max_wall_m)
        if found is None:
            found = place_door(opening, outlines, all_pairs(outlines), max_wall_m)
            if found is not None and known and not set(known) <= set(found[0].between):
                found = None
    if found is not None:
        cut, change = found
        low = min(layout.plan.space(room).height_m for room in cut.between)
        if change > 0.01:
            report.guessed.append(f"door {opening.name}: moved or narrowed by {100 * change:.0f} cm to fit its wall")
        return _limit_size(cut, low)
    if not opening.has_leaf:
        report.left_out.append(f"{opening.name}: an opening, but not between two spaces of one storey")
        return None
    out = place_outer_door(opening, {room: outlines[room] for room in known} or outlines)
    if out is None:
        joined = f" of {' and '.join(known)}" if known else ""
        report.left_out.append(f"door {opening.name}: no wall{joined} where it should be")
        return None
    report.guessed.append(f"door {opening.name}: leads out of {out.between[0]} to no space of the file; drawn closed")
    return _limit_size(out, layout.plan.space(out.between[0]).height_m)


def _limit_size(cut: PlacedOpening, ceiling_m: float) -> PlacedOpening:
    """The opening with HEADER_M of wall above it, no larger than a world may have it, in tenths of a millimetre."""
    height_m, width_m = min(cut.height_m, ceiling_m - HEADER_M, MAX_OPENING_M), min(cut.width_m, MAX_OPENING_M)
    return replace(cut, along_m=round(cut.along_m, 4), width_m=round(width_m, 4), height_m=round(height_m, 4))


def _place_wide_opening(layout: Layout, a: str, b: str, outlines: Mapping[str, Floats]) -> None:
    plan, report = layout.plan, layout.plan.report
    own = [cut for cut in layout.cuts if {a, b} & set(cut.between)]
    height = min(plan.space(room).height_m for room in (a, b)) - HEADER_M
    solid = [footprint(thing) for room in (a, b) for thing in layout.furnishings.get(room, ()) if is_obstacle(thing)]
    barriers = plan.barriers.get(plan.space(a).storey, ())
    cut = place_wide_opening(f"{a}-to-{b}", a, b, outlines, height, own, MAX_MEETING_GAP_M, solid, barriers)
    if cut is None or overlap(cut, layout.cuts, layout.rooms):
        report.left_out.append(f"{a} and {b} meet without a wall, but not along a line with room for an opening")
        return
    cut = _limit_size(cut, height + HEADER_M)
    layout.cuts.append(cut)
    report.guessed.append(f"{a} to {b}: no wall between them in the file; an opening {cut.width_m:.2f} m wide, "
                           "where no furniture stands in the way")


def _place_windows(layout: Layout, storey: str) -> None:
    plan, report = layout.plan, layout.plan.report
    outlines = _outlines(layout, storey)
    for window in (w for w in plan.windows if w.storey == storey):
        panes = find_panes(window, outlines)
        if not panes:
            report.left_out.append(f"window {window.name}: no wall of a space runs along it")
        for pane in panes:
            space = plan.space(pane.room)
            low, high = window.sill_m - space.floor_m, window.sill_m + window.height_m - space.floor_m
            ceiling_m = space.height_m - LINTEL_M
            if min(high, ceiling_m) - max(low, 0.0) < MIN_PANE_M:
                report.left_out.append(f"window {window.name}: from {low:.2f} to {high:.2f} m above the floor of "
                                       f"{pane.room}, whose ceiling is at {space.height_m:.2f} m")
                continue
            layout.panes.append((pane, window))
            if high > space.height_m:
                report.guessed.append(f"window {window.name}: ends at {ceiling_m:.2f} m, as the ceiling of {pane.room} "
                                      f"is at {space.height_m:.2f} m and its top at {high:.2f} m")


def _place_furniture(layout: Layout) -> None:
    report = layout.plan.report
    for thing in layout.plan.furnishings:
        if thing.room not in layout.rooms:
            report.left_out.append(f"{thing.name}: its space is not there")
            continue
        placed = fit_into_room(thing, layout.rooms[thing.room], layout.plan.space(thing.room))
        if placed is None:
            report.left_out.append(f"{thing.name}: does not fit into {thing.room}")
        else:
            layout.furnishings.setdefault(thing.room, []).append(placed)


def _clear_doorways(layout: Layout) -> None:
    """Remove furniture from open doorways: a file may have a mat, or a door's own handle, as furniture."""
    for cut in (cut for cut in layout.cuts if cut.is_open):
        floor = shapely.Polygon(doorway(cut, layout.rooms, DOORWAY_CLEARANCE_M))
        for room in cut.between:
            for thing in list(layout.furnishings.get(room, ())):
                if bottom_m(thing) < cut.height_m and shapely.Polygon(footprint(thing)).intersection(floor).area > 1e-4:
                    layout.furnishings[room].remove(thing)
                    layout.plan.report.left_out.append(f"{thing.name}: it stands in the doorway {cut.name}")


def _report_steps(layout: Layout) -> None:
    """Report steps and ramps between rooms of one storey, as storeys are drawn level."""
    for cut in (cut for cut in layout.cuts if cut.is_open):
        floors = [layout.plan.space(room).floor_m for room in cut.between]
        if abs(floors[0] - floors[1]) > MAX_STEP_M:
            layout.plan.report.guessed.append(f"{cut.name}: from {cut.between[0]} to {cut.between[1]} the floor goes "
                                               f"{'down' if floors[1] < floors[0] else 'up'} by "
                                               f"{abs(floors[0] - floors[1]):.2f} m in the file; drawn level")


def _spread_storeys(layout: Layout) -> None:
    """Lay storeys out side by side: the lowest stays, the others are moved north of it."""
    used = [s for s in layout.plan.storeys if any(space.name in layout.rooms for space in layout.plan.on(s.name))]
    top = None
    for storey in used:
        points = np.concatenate([layout.rooms[s.name] for s in layout.plan.on(storey.name) if s.name in layout.rooms])
        low, high = float(points[:, 1].min()), float(points[:, 1].max())
        move = 0.0 if top is None else float(np.ceil(top + STOREY_GAP_M - low))
        layout.north_m[storey.name] = move
        top = high + move
        if abs(top) > MAX_EXTENT_M or np.abs(points).max() > MAX_EXTENT_M:
            raise BuildingError(f"{layout.plan.source}: expected a building within {MAX_EXTENT_M:.0f} m of its origin, "
                                f"got a storey {storey.name} that reaches beyond")
    if len(used) > 1:
        layout.plan.report.guessed.append(
            f"storeys lie over one another: on the plan they are {STOREY_GAP_M:.0f} m or more apart, each moved north "
            f"({', '.join(f'{s} by {m:g} m' for s, m in layout.north_m.items())}); their height is a property")


def _order_rooms(layout: Layout) -> None:
    """Put the largest connected set of rooms first, and say of all others why they cannot be reached from it."""
    graph = nx.Graph()
    graph.add_nodes_from(layout.rooms)
    graph.add_edges_from(cut.between for cut in layout.cuts if len(cut.between) == 2)
    graph.add_edges_from(way.between for way in layout.plan.links)
    order = {name: index for index, name in enumerate(layout.rooms)}
    parts = sorted(nx.connected_components(graph), key=lambda part: (-len(part), min(order[name] for name in part)))
    layout.rooms = {name: layout.rooms[name] for part in parts for name in sorted(part, key=order.__getitem__)}
    for part in parts[1:]:
        for name in sorted(part, key=order.__getitem__):
            why = _why_shut_off(layout, name, part, next(iter(layout.rooms)))
            layout.shut_off[name] = why
    for part in parts[1:]:
        names = sorted(part, key=order.__getitem__)
        layout.plan.report.left_out.append(f"a way to {', '.join(names)}: {layout.shut_off[names[0]]}")


def _why_shut_off(layout: Layout, name: str, part: set[str], first: str) -> str:
    doors = [cut.name for cut in layout.cuts if len(cut.between) == 1 and cut.between[0] in part]
    if doors:
        return f"from {first} only out of doors, by {', '.join(doors)}, and the file has no space there"
    return "the file has no door, opening or stairs that lead there"


def _mark_full_rooms(layout: Layout) -> None:
    """Mark rooms that are too small or too full for a robot."""
    for name, outline in layout.rooms.items():
        solid = [shapely.Polygon(footprint(thing)).buffer(ROBOT_RADIUS_M) for thing in layout.furnishings.get(name, ())
                 if bottom_m(thing) < ROBOT_TOP_M]
        if shapely.Polygon(outline).buffer(-ROBOT_RADIUS_M).difference(shapely.union_all(solid)).is_empty:
            layout.full.add(name)
    if layout.full:
        layout.plan.report.left_out.append(f"no place for a robot of {ROBOT_RADIUS_M} m radius (said as a property): "
                                            f"{', '.join(n for n in layout.rooms if n in layout.full)}")


def neighbours_without_wall(spaces: Sequence[Space], which: set[str],
                            barriers: Sequence[shapely.Geometry] = ()) -> set[frozenset[str]]:
    """Pairs of spaces of one storey, both among ``which``, that touch along a line.

    With barriers, only pairs between which they leave room for a wide opening.
    """
    kept, _ = separate_outlines({space.name: space.outline for space in spaces if space.name in which})
    pairs = [(a, b) for a, b in all_pairs(kept)
             if any(s.gap_m < MAX_MEETING_GAP_M for s in find_facing_stretches(a, kept[a], b, kept[b]))]
    return {frozenset((a, b)) for a, b in pairs
            if not barriers or place_wide_opening("", a, b, kept, 1.0, (), MAX_MEETING_GAP_M, (), barriers) is not None}
