"""A ROS map (``map.yaml`` with its picture) as a building plan: rooms, walls and doors traced from the grid.

The grid is turned so that most walls run along its axes (:class:`Grid` knows the way back into the map's frame), its
floor is parted into rooms (:mod:`.ros_map_rooms`), and each room gets straight walls, with each doorway's wall between
its two rooms.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage

from harvey_buildings.fitting.building_plan import (
    TRACED_M,
    BuildingError,
    BuildingPlan,
    Floats,
    NoWayError,
    Space,
    Storey,
    WallOpening,
    slug,
)
from harvey_buildings.fitting.polygons import clean_outline, extract_outline, square_outline
from harvey_buildings.formats.ros_map_file import (
    FREE,
    OCCUPIED,
    SAVED_UNKNOWN,
    UNKNOWN,
    Cells,
    MapFile,
    read_cells,
    read_map_yaml,
)
from harvey_buildings.formats.ros_map_openings import Gap, Mask, trace
from harvey_buildings.formats.ros_map_rooms import Labels, clean_floor, part_rooms, rooms_beside
from world_models.building.checks import Watched, pass_on

MARGIN_CELLS = 3
MIN_TURN_RAD = math.radians(0.3)
COARSE_DEG, NEAR_DEG, FINE_DEG = 0.5, 1.5, 0.1
PLATEAU = 0.96
"""Thick walls make the top of the profile flat: its middle is taken, from this share of the top on."""
MIN_CONTRAST = 1.3
"""The profile along the walls is this many times the median of all directions, or none prevails."""
MIN_WALL_CELLS, MAX_WALL_CELLS = 50, 30_000


@dataclass(frozen=True, eq=False, slots=True)
class Grid:
    """Cells with most walls along rows and columns.

    Attributes:
        cells: (rows, columns) of FREE, OCCUPIED, UNKNOWN.
        cell_m: side of a cell [m].
        turn_rad: angle from the picture's axes to the walls', counter-clockwise.
        matrix, offset: (row, column) of the picture is matrix @ (row, column) + offset.
        rows: of the picture.
        origin: of the map file.
    """

    cells: Cells
    cell_m: float
    turn_rad: float
    matrix: Floats
    offset: Floats
    rows: int
    origin: tuple[float, float, float]

    def to_map(self, points: Floats) -> Floats:
        """(n, 2) rows and columns, the middle of a cell being whole numbers, as x, y in the map's frame [m]."""
        picture = points @ self.matrix.T + self.offset
        flat = np.column_stack([picture[:, 1] + 0.5, self.rows - 0.5 - picture[:, 0]]) * self.cell_m
        x, y, yaw = self.origin
        c, s = math.cos(yaw), math.sin(yaw)
        return np.asarray(flat @ np.array([[c, s], [-s, c]]) + np.array([x, y]))

    def to_map_polygon(self, shape: shapely.Geometry) -> shapely.Geometry:
        """A shape in columns and rows as one in the map's frame."""
        return shapely.transform(shape, lambda points: self.to_map(points[:, ::-1]))

    def direction(self, along: Floats) -> Floats:
        """(2,) unit direction in the map's frame of a direction in rows and columns."""
        ends = self.to_map(np.array([[0.0, 0.0], along]))
        return np.asarray((ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0]))


def make_grid(cells: Cells, file: MapFile) -> Grid:
    """The known part of a picture, turned."""
    rows = len(cells)
    known = np.argwhere(cells != UNKNOWN)
    low = np.maximum(known.min(axis=0) - MARGIN_CELLS, 0)
    part = cells[low[0] : known[:, 0].max() + MARGIN_CELLS + 1, low[1] : known[:, 1].max() + MARGIN_CELLS + 1]
    part = np.pad(part, MARGIN_CELLS, constant_values=UNKNOWN)
    offset = low.astype(np.float64) - MARGIN_CELLS
    turn = find_wall_turn(part)
    if not turn:
        return Grid(part, file.resolution_m, 0.0, np.eye(2), offset, rows, file.origin)
    c, s = math.cos(turn), math.sin(turn)
    matrix = np.array([[c, -s], [s, c]])  # rows and columns of the turned grid to those of the picture
    size = np.array(part.shape)
    wide = np.ceil(np.abs(matrix.T) @ size).astype(int)
    shift = (size - 1) / 2 - matrix @ ((wide - 1) / 2)
    turned = ndimage.affine_transform(part, matrix, shift, output_shape=tuple(wide), order=0, cval=int(UNKNOWN))
    return Grid(np.asarray(turned, dtype=np.int8), file.resolution_m, turn, matrix, offset + shift, rows, file.origin)


def find_wall_turn(cells: Cells) -> float:
    """The angle [rad], within 45 degrees, counter-clockwise from the picture's axes to most walls; 0: none prevails.

    Along the walls' direction the occupied cells fall on few rows and columns: the sum of the squares of their numbers
    is largest (the projection profile, as pages of text are straightened).
    """
    faces = (cells == OCCUPIED) & ndimage.binary_dilation(cells == FREE, iterations=2)
    rows, columns = np.nonzero(faces)
    if len(rows) < MIN_WALL_CELLS:
        return 0.0
    step = math.ceil(len(rows) / MAX_WALL_CELLS)
    x, y = columns[::step].astype(np.float64), -rows[::step].astype(np.float64)
    coarse = np.arange(-45.0, 45.0, COARSE_DEG)
    heights = np.array([_profile(x, y, angle) for angle in coarse])
    best = coarse[int(np.argmax(heights))]
    if heights.max() < MIN_CONTRAST * np.median(heights):
        return 0.0
    fine = best + np.arange(-NEAR_DEG, NEAR_DEG + FINE_DEG / 2, FINE_DEG)
    heights = np.array([_profile(x, y, angle) for angle in fine])
    turn = math.radians(float(fine[heights >= PLATEAU * heights.max()].mean()))
    return turn if abs(turn) > MIN_TURN_RAD else 0.0


def _profile(x: Floats, y: Floats, angle_deg: float) -> float:
    """The sum of squares of how many cells lie on each row and each column of axes turned by an angle."""
    c, s = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    counts = [np.bincount(np.round(axis - axis.min()).astype(int)) for axis in (c * x + s * y, c * y - s * x)]
    return float(np.square(np.concatenate(counts).astype(np.float64)).sum())


SMOOTH_M = 0.12
"""Notches and spurs of walls narrower than twice this are smoothed."""
STRAIGHT_CELLS = 1.6
"""Corners nearer than this to a straight wall are taken for noise."""
MIN_WALL_M, MAX_WALL_M = 0.06, 0.5
"""Thickness of the wall between two rooms at a gap."""
STEP_M = 0.2
"""Depth of the floor that is sure to be before a gap."""
JAMB_M = 0.06
"""Wall at either side of a gap that is kept straight."""


def room_shape(
    room: Mask, gaps: list[tuple[Gap, int]], cell_m: float, first: tuple[int, int],
) -> shapely.Polygon | None:
    """The outline of a room's cells, as a polygon in columns and rows; None where nothing is left.

    Args:
        room: (rows, columns) its part of the grid.
        gaps: those beside it, each with the side on which the room is: 1 or -1, as ``rooms_beside`` has them.
        first: column and row of the part's first cell.
    """
    margin = round(SMOOTH_M / cell_m) + 2
    smooth = _smooth(np.pad(room, margin), SMOOTH_M / cell_m)
    corner = np.array(first) - margin
    shape = _largest(shapely.transform(trace(smooth), lambda points: points + corner))
    if shape is None:
        return None
    outline = clean_outline(shapely.get_coordinates(shape.simplify(STRAIGHT_CELLS).exterior) * cell_m)
    if outline is None:
        return None
    squared = shapely.Polygon(square_outline(outline) / cell_m)
    holes = [shapely.Polygon(ring) for ring in shape.interiors]
    squared = squared.difference(shapely.union_all([h.simplify(STRAIGHT_CELLS) for h in holes if h.area > 4]))
    before = shapely.union_all([_step(gap, side, cell_m) for gap, side in gaps])
    return _largest(squared.union(before).difference(shapely.union_all([_throat(gap, cell_m) for gap, _ in gaps])))


def _throat(gap: Gap, cell_m: float) -> shapely.Polygon:
    """The wall in which a gap is, from a little before the one jamb to a little behind the other: columns, rows."""
    middle, half, thick = _axes(gap, cell_m)
    half = half * (1 + 2 * JAMB_M / (gap.width * cell_m))
    return shapely.Polygon([middle - half - thick, middle + half - thick, middle + half + thick, middle - half + thick])


def _step(gap: Gap, side: int, cell_m: float) -> shapely.Polygon:
    """The floor before a gap on one side: columns, rows."""
    middle, half, thick = _axes(gap, cell_m)
    far = side * (thick + thick / np.linalg.norm(thick) * STEP_M / cell_m)
    return shapely.Polygon([middle - half, middle + half, middle + half + far, middle - half + far])


def _axes(gap: Gap, cell_m: float) -> tuple[Floats, Floats, Floats]:
    """The middle of a gap, half of its width along the wall, and half of the wall's thickness: columns, rows."""
    start, end = np.array(gap.start[::-1], float), np.array(gap.end[::-1], float)
    along = (end - start) / np.linalg.norm(end - start)
    thick = min(max(gap.depth, MIN_WALL_M / cell_m), MAX_WALL_M / cell_m)
    return np.array(gap.middle[::-1]), gap.width / 2 * along, thick / 2 * np.array([-along[1], along[0]])


def _smooth(room: Mask, radius: float) -> NDArray[np.bool_]:
    """The cells opened and closed by a square, which keeps the corners of straight walls."""
    square = np.ones((2 * int(radius) + 1,) * 2, bool)
    opened = ndimage.binary_opening(room, square)
    return np.asarray(ndimage.binary_closing(opened if opened.any() else room, square), dtype=bool)


def _largest(shape: shapely.Geometry) -> shapely.Polygon | None:
    parts = [part for part in shapely.get_parts(shape) if part.geom_type == "Polygon" and part.area > 0]
    return max(parts, key=lambda part: part.area, default=None)


def gap_on_map(gap: Gap) -> tuple[Floats, Floats]:
    """(2,) middle and (2,) direction of a gap, in rows and columns."""
    along = np.array(gap.end, float) - np.array(gap.start, float)
    return np.array(gap.middle), along / np.linalg.norm(along)


def fill_to_walls(labels: Labels, open_floor: Mask, cells: int) -> Labels:
    """The rooms grown by up to so many cells into floor that was opened away at corners and jambs."""
    nearest = ndimage.distance_transform_edt(labels == 0, return_distances=False, return_indices=True)
    joined = ndimage.binary_dilation(labels > 0, iterations=cells, mask=(labels > 0) | open_floor)
    return np.where(joined, labels[nearest[0], nearest[1]], labels)  # what is hollow behind a wall is not reached


WALL_HEIGHT_M, DOOR_HEIGHT_M = 2.5, 2.05
MIN_DOOR_M = 0.6
HEADER_M = 0.3
STOREY = "ground"
MOST_PIECES = 20_000


def read_ros_map(path: Path, wall_height_m: float = WALL_HEIGHT_M, *, watched: Watched = pass_on) -> BuildingPlan:
    """The plan of a ROS map, in the map's frame. Raises BuildingError where it cannot be read or has no room,
    NoWayError where most rooms have no doorway."""
    file = read_map_yaml(path)
    cells = read_cells(file)
    for value, what, key in ((FREE, "free", "free_thresh"), (OCCUPIED, "occupied", "occupied_thresh")):
        if not (cells == value).any():
            raise BuildingError(f"{file.image.name}: expected free and occupied cells, got no {what} one "
                                f"(see {key} and negate in {path.name})")
    pieces = sum(ndimage.label(cells == value)[1] for value in (FREE, OCCUPIED))
    if pieces > MOST_PIECES:
        raise BuildingError(f"{file.image.name}: expected floor and walls in at most {MOST_PIECES} pieces, got "
                            f"{pieces}: this is no plan of rooms")
    grid = make_grid(cells, file)
    floor, things = clean_floor(grid.cells == FREE, grid.cell_m)
    labels, gaps = part_rooms(floor, grid.cell_m)
    labels = fill_to_walls(labels, grid.cells == FREE, max(1, round(0.15 / grid.cell_m)))
    plan = BuildingPlan(slug(path.stem) or "map", path.name, [Storey(STOREY, 0.0)],
                        sigma_m=max(TRACED_M, file.resolution_m))
    names = _add_rooms(plan, labels, gaps, grid, wall_height_m, watched)
    if not names:
        raise BuildingError(f"{file.image.name}: expected a room of {1.5:g} m2 or more with walls, got none in "
                            f"{cells.shape[1]} x {cells.shape[0]} cells of {file.resolution_m:g} m")
    _add_doors(plan, labels, gaps, names, grid)
    joined = {room for opening in plan.openings for room in opening.rooms}
    if len(names) > 1 and len(joined) < len(names) / 2:
        raise NoWayError(f"{file.image.name}: expected a doorway to most rooms, got none to "
                         f"{len(names) - len(joined)} of {len(names)}: its walls or gaps are not those of rooms")
    _report(plan, file, grid, labels, len(things))
    return plan


def _add_rooms(plan: BuildingPlan, labels: Labels, gaps: list[Gap], grid: Grid, wall_height_m: float,
               watched: Watched) -> dict[int, str]:
    """Add a space for each room of the grid; its name by its number. From the top left to the bottom right."""
    names: dict[int, str] = {}
    beside: dict[int, list[tuple[Gap, int]]] = {}
    for gap in gaps:
        for room, side in zip(rooms_beside(gap, labels, grid.cell_m), (1, -1), strict=False):
            beside.setdefault(room, []).append((gap, side))
    bounds = ndimage.find_objects(labels)
    for number in watched([k for k, there in enumerate(bounds, 1) if there is not None], "rooms traced"):
        rows, columns = bounds[number - 1]
        shape = room_shape(labels[rows, columns] == number, beside.get(number, []), grid.cell_m,
                           (columns.start, rows.start))
        outline = _trace_outline(grid.to_map_polygon(shape)) if shape is not None else None
        if outline is None:
            area_m2 = float((labels[rows, columns] == number).sum()) * grid.cell_m**2
            plan.report.left_out.append(f"a part of {area_m2:.1f} m2: no outline could be traced")
            continue
        names[number] = f"room-{len(names) + 1}"
        plan.spaces.append(Space(names[number], "room", names[number], STOREY, outline, 0.0, wall_height_m))
    return names


def _trace_outline(shape: shapely.Geometry) -> Floats | None:
    """The outline (k, 2) of a shape; where it touches itself, without its narrowest parts."""
    for narrow_m in (0.03, 0.06, 0.12):
        part = shape.buffer(-narrow_m, join_style="mitre").buffer(narrow_m, join_style="mitre") if narrow_m else shape
        outline = extract_outline(part)
        if outline is not None:
            return outline
    return None


def _add_doors(plan: BuildingPlan, labels: Labels, gaps: list[Gap], names: dict[int, str], grid: Grid) -> None:
    """Add an opening for each gap that parts two rooms."""
    height_m = min(DOOR_HEIGHT_M, plan.spaces[0].height_m - HEADER_M)
    for gap in gaps:
        rooms = tuple(names[k] for k in rooms_beside(gap, labels, grid.cell_m) if k in names)
        width_m = gap.width * grid.cell_m
        if len(rooms) != 2 or width_m < MIN_DOOR_M:
            continue
        middle, along = gap_on_map(gap)
        plan.openings.append(WallOpening(f"door-{len(plan.openings) + 1}", STOREY, grid.to_map(middle[None])[0],
                                         width_m, height_m, rooms, grid.direction(along)))


def _report(plan: BuildingPlan, file: MapFile, grid: Grid, labels: Labels, things: int) -> None:
    report, known = plan.report, grid.cells != UNKNOWN
    report.used.append(f"{file.image.name}: {int(known.sum())} known cells of {file.resolution_m:g} m, "
                       f"{len(plan.spaces)} rooms, {len(plan.openings)} doorways; coordinates are the map's")
    report.guessed.append(f"walls are {plan.spaces[0].height_m:g} m high and doorways "
                          f"{min(DOOR_HEIGHT_M, plan.spaces[0].height_m - HEADER_M):g} m: a grid has no heights")
    report.guessed.append("rooms end where a wall has a gap; their names are numbers, from the top of the picture down")
    report.guessed.append("what is unknown beside free floor is taken for wall")
    if file.mode != "raw" and not file.free <= SAVED_UNKNOWN <= file.occupied:
        report.guessed.append(f"cells of grey {50 if file.negate else 205} are unknown, as savers write them, whatever "
                              f"free_thresh {file.free:g} and occupied_thresh {file.occupied:g} say")
    if grid.turn_rad:
        report.guessed.append(f"most walls run {abs(math.degrees(grid.turn_rad)):.1f} degrees off the picture's axes; "
                              "walls nearly along those directions are straightened to them")
    outside = int(((grid.cells == FREE) & (labels == 0)).sum())
    if outside:
        report.left_out.append(f"{outside * grid.cell_m**2:.1f} m2 of free cells in no room: rays through windows, "
                               "pockets in walls and furniture")
    if things:
        report.left_out.append(f"{things} things that stand free on the floor (legs, bins, furniture, speckle)")
