"""What was explored as a world file: rooms, doorways, and what hangs on the walls, by the pictures of all stands.

Each wall is seen straight on, every point of it in the picture that shows it best; what differs from the wall's colour
and fills a rectangle is taken over as a board of that colour. Colours are those of the pictures, less the light that
the model expects.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from harvey_survey.axis_map import ACROSS, OUTWARD, SIGN, AxisMap, LearntDoor, LearntRoom, meet_wall
from world_models.building.geometry.faces import AMBIENT, LAMP_DIRECTION
from world_models.files.construction.rooms import (
    BASEBOARD_DEPTH_M,
    BASEBOARD_HEIGHT_M,
    CASING_WIDTH_M,
    MOULDING_DEPTH_M,
    MOULDING_HEIGHT_M,
)

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

SIDES = ("south", "east", "north", "west")
PIXEL_M = 0.01
"""Of the straight view of a wall."""
MAX_HEIGHT_M, USUAL_HEIGHT_M, HEIGHT_BIN_M = 4.0, 2.7, 0.02
MAX_SLANT, SIGHT_M = 2.0, (0.9, 7.0)
"""A point of a wall is taken from pictures that show it no further aside (tangent), and from so near to so far."""
GAIN = 1.25
"""By so much cameras make pictures brighter than a surface of full light is."""
UNLIKE = 22.0
"""What differs so much in a colour (0..255) from what is round it, is another thing."""
BOARD_M, BOARD_FILL = 0.14, 0.86
"""Least side of a board, and the least share that it fills of its rectangle."""
BOARD_DEPTH_M = 0.02
RIM_M = 0.03
SIGMA_CM = 1.0
"""How well all is known, as the file states it."""


@dataclass(frozen=True, slots=True)
class WallBoard:
    """A rectangle on a wall: from where to where along it and up [m], and its colour (3,) 0..255."""

    along_m: tuple[float, float]
    up_m: tuple[float, float]
    colour: Floats


@dataclass(frozen=True, eq=False, slots=True)
class WallView:
    """A wall seen straight on: picture (rows up from the floor, columns along it), and which of it was seen."""

    picture: Floats
    seen: Mask
    start_m: float

    def columns(self, low_m: float, high_m: float) -> slice:
        """Those from a place along the wall to another."""
        return slice(*(max(0, int((m - self.start_m) / PIXEL_M)) for m in (low_m, high_m)))

    def colour(self, along_m: tuple[float, float], up_m: tuple[float, float]) -> Floats | None:
        """The usual colour (3,) of a rectangle; None where hardly any of it was seen."""
        part = slice(max(0, int(up_m[0] / PIXEL_M)), max(0, int(up_m[1] / PIXEL_M))), self.columns(*along_m)
        found = self.picture[part][self.seen[part]]
        return np.median(found, axis=0) if len(found) >= 20 else None


def view_wall(built: AxisMap, room: LearntRoom, side: int) -> WallView:
    """A wall by all pictures that were taken in its room."""
    low, high = room.span(side)
    columns, rows = max(1, int((high - low) / PIXEL_M)), int(room.height_m / PIXEL_M)
    along, up = low + (np.arange(columns) + 0.5) * PIXEL_M, (np.arange(rows) + 0.5) * PIXEL_M
    axis = ACROSS[side]
    points = np.zeros((rows, columns, 3))
    points[..., axis], points[..., 1 - axis], points[..., 2] = room.limit(side), along, up[:, None]
    picture, best = np.zeros((rows, columns, 3)), np.full((rows, columns), np.inf)
    for n, stand in enumerate(built.stands):
        if stand.room != room.name:
            continue
        for view in stand.views:
            eye = built.position(n) + view.forward_m
            away = SIGN[side] * (room.limit(side) - eye[axis])
            if away < 0.2:
                continue
            slant = np.abs(along - eye[1 - axis]) / away
            far = away * np.hypot(1.0, slant)
            cost = np.where((slant < MAX_SLANT) & (far > SIGHT_M[0]) & (far < SIGHT_M[1]), far * np.hypot(1.0, slant),
                            np.inf)
            facing = points[0, :, :2] - eye
            ahead = facing @ [math.cos(view.heading_rad), math.sin(view.heading_rad)]
            near = np.flatnonzero(np.isfinite(cost) & (ahead > 0.5 * np.hypot(*facing.T)))
            if not len(near):
                continue
            part = slice(near[0], near[-1] + 1)
            colours, inside = view.colours_at(points[:, part] - [eye[0], eye[1], 0.0])
            better = inside & (cost[part] < best[:, part])
            picture[:, part][better] = colours[better]
            best[:, part] = np.where(better, cost[part], best[:, part])
    return WallView(picture, np.isfinite(best), low)


def measure_height(built: AxisMap, room: LearntRoom) -> float:
    """How high a room is: its uppermost level lines that meet a wall's plane; the usual height where none is seen."""
    heights: list[float] = []
    weights: list[float] = []
    for n, stand in enumerate(built.stands):
        if stand.room != room.name:
            continue
        for view in stand.views:
            eye = built.position(n) + view.forward_m
            lines = view.lines.take(view.lines.lengths_px >= 30.0)
            ends = view.camera.rays(lines.segments_px) @ view.mount.camera_from_robot.rotation
            slopes = ends[..., 2] / np.hypot(ends[..., 0], ends[..., 1])
            bearings = np.arctan2(ends[..., 1], ends[..., 0]) + view.heading_rad
            for slope, pair, length in zip(slopes.tolist(), bearings.tolist(), lines.lengths_px.tolist(), strict=True):
                (side, _, *a), (other, _, *b) = (meet_wall(room, eye, bearing) for bearing in pair)
                is_seen = side == other >= 0 and room.walls[side] is not None and min(a[1], b[1]) < SIGHT_M[1]
                if is_seen and min(slope) > 0.02:
                    low, high = sorted(view.mount.height_m + rise * (far - MOULDING_DEPTH_M * math.hypot(1.0, slant))
                                       for rise, (slant, far) in zip(slope, (a, b), strict=True))
                    if high - low < 0.03 and 2.0 < low < MAX_HEIGHT_M:
                        heights.append(0.5 * (low + high))
                        weights.append(length)
    if not heights:
        return USUAL_HEIGHT_M
    at, weight = np.array(heights), np.array(weights)
    support = np.array([weight[np.abs(at - h) < HEIGHT_BIN_M].sum() for h in at])
    top = at[support > 0.3 * support.max()].max()
    near = np.abs(at - top) < HEIGHT_BIN_M
    return float(np.average(at[near], weights=weight[near]))


def find_boards(wall: WallView, height_m: float, doors: Sequence[tuple[float, float]]) -> list[list[WallBoard]]:
    """The rectangles on a wall that differ from it, outside its doorways, each with that which is on it."""
    columns = wall.seen.shape[1]
    usable = wall.seen.copy()
    usable[: int((BASEBOARD_HEIGHT_M + 0.04) / PIXEL_M)] = False
    usable[int((height_m - MOULDING_HEIGHT_M - 0.05) / PIXEL_M) :] = False
    edge = int(0.06 / PIXEL_M)
    usable[:, :edge], usable[:, columns - edge :] = False, False
    for low, high in doors:
        usable[:, wall.columns(low - CASING_WIDTH_M - 0.05, high + CASING_WIDTH_M + 0.05)] = False
    if np.count_nonzero(usable) < 100:
        return []
    smooth = cv2.medianBlur(wall.picture.astype(np.uint8), 5).astype(float)
    ground = np.median(smooth[usable], axis=0)
    unlike = usable & (np.abs(smooth - ground).max(axis=2) > UNLIKE)
    boards = []
    for (r0, r1), (c0, c1) in _find_boxes(unlike):
        if r1 >= int((height_m - MOULDING_HEIGHT_M - 0.06) / PIXEL_M) or min(r0, c0) <= 0:
            continue
        if not usable[max(0, r0 - 2) : r1 + 2, max(0, c0 - 2) : c1 + 2].all():
            continue  # it ends at what was not seen, and may go on there
        rim = max(1, int(RIM_M / PIXEL_M) // 2)
        border = np.concatenate([smooth[r0 + 1 : r0 + 1 + rim, c0:c1].reshape(-1, 3),
                                 smooth[r0:r1, c0 + 1 : c0 + 1 + rim].reshape(-1, 3),
                                 smooth[r0:r1, c1 - 1 - rim : c1 - 1].reshape(-1, 3)])
        outer = np.median(border, axis=0)
        differs = np.zeros_like(unlike)
        differs[r0 + 1 : r1 - 1, c0 + 1 : c1 - 1] = (
            np.abs(smooth[r0 + 1 : r1 - 1, c0 + 1 : c1 - 1] - outer).max(axis=2) > UNLIKE)
        inner = [((rows, columns), np.median(smooth[slice(*rows), slice(*columns)].reshape(-1, 3), axis=0))
                 for rows, columns in _find_boxes(differs)[:1]]
        every, at = [(((r0, r1), (c0, c1)), outer), *inner], wall.start_m
        boards.append([WallBoard((at + a * PIXEL_M, at + b * PIXEL_M), (low * PIXEL_M, high * PIXEL_M), colour)
                       for ((low, high), (a, b)), colour in every])
    return boards


def _find_boxes(mask: Mask) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Rectangles that parts of a mask fill, the largest first: rows and columns from and to."""
    count, _, facts, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=4)
    found = []
    for k in range(1, count):
        c0, r0, width, height, area = (int(v) for v in facts[k])
        filled = np.count_nonzero(cv2.morphologyEx(
            mask[r0 : r0 + height, c0 : c0 + width].astype(np.uint8), cv2.MORPH_CLOSE, np.ones((9, 9), np.uint8)))
        ring = np.concatenate([mask[r0, c0 : c0 + width], mask[r0 + height - 1, c0 : c0 + width],
                               mask[r0 : r0 + height, c0], mask[r0 : r0 + height, c0 + width - 1]])
        if min(width, height) * PIXEL_M >= BOARD_M and (
                filled >= BOARD_FILL * width * height or (ring.mean() > 0.7 and area > 0.15 * width * height)):
            found.append((width * height, ((r0, r0 + height), (c0, c0 + width))))
    return [box for _, box in sorted(found, reverse=True)]


# -- the file ----------------------------------------------------------------------------------------------------------


def write_learnt_world(built: AxisMap, name: str) -> str:
    """The text of a world file, in metres, in the axes' frame. The first room has the start."""
    finishes: dict[str, str] = {}
    locales, doors = [], []
    views: dict[str, list[WallView]] = {}
    for room in built.rooms.values():
        room.height_m = measure_height(built, room)
        views[room.name] = [view_wall(built, room, side) for side in range(4)]
        locales.append(_format_room(built, room, views[room.name], finishes))
    for number, door in enumerate(door for door in built.doors if door.behind in built.rooms):
        doors.append(_format_door(built, door, views[door.room][door.side], number + 1, finishes))
    head = [f"# By harvey explore: {len(built.rooms)} rooms, {len(doors)} doorways, by {len(built.stands)} stands.",
            "# Metres. The start is the origin; x and y are the building's axes.",
            f'name = "{name}"', 'units = "metres"', f"sigma_cm = {SIGMA_CM:g}", "", "[finishes]",
            'unknown = { colour = "unknown" }', *(f"{key} = {value}" for key, value in finishes.items()), "",
            "[defaults]", 'ceiling = "unknown"', 'threshold = "unknown"', 'leaf = "unknown"', "",
            "[locales.storey]", 'kind = "floor"']
    return "\n".join([*head, *locales, "", "[doors]", *doors]) + "\n"


def _format_room(built: AxisMap, room: LearntRoom, views: Sequence[WallView], finishes: dict[str, str]) -> str:
    boarded = _has_strip(views, (0.02, BASEBOARD_HEIGHT_M - 0.02), (0.14, 0.4))
    moulded = _has_strip(views, (room.height_m - MOULDING_HEIGHT_M + 0.02, room.height_m - 0.025),
                         (room.height_m - 0.4, room.height_m - 0.14))
    back = BASEBOARD_DEPTH_M if boarded is not None else 0.0
    x0, y0, x1, y1 = room.box
    origin, size = (x0 - back, y0 - back), (x1 - x0 + 2.0 * back, y1 - y0 + 2.0 * back)
    walls: list[str] = []
    things: list[str] = []
    for side, view in enumerate(views):
        ways = [ends for wall, ends in built.list_ways(room.name) if wall == side]
        colour = view.colour(room.span(side), (0.2, room.height_m - 0.2))
        finish = "unknown" if colour is None else _finish(finishes, f"{room.name}-{SIDES[side]}", colour, side)
        walls.append(f'{SIDES[side]} = "{finish}"')
        for boards in find_boards(view, room.height_m, ways):
            name = f"{room.name}-{len(things)}"
            things.append(_format_boards(boards, side, origin[1 - ACROSS[side]], name, finishes))
    floor = _finish(finishes, f"{room.name}-floor", room.floor.colour, -1)
    lines = ["", f"[locales.{room.name}]", 'kind = "room"', 'in = "storey"',
             f"at = [{origin[0]:.3f}, {origin[1]:.3f}]", f"size = [{size[0]:.3f}, {size[1]:.3f}]",
             f"height = {room.height_m:.3f}", f"walls = {{ {', '.join(walls)} }}", f'floor = "{floor}"']
    for key, strip in (("baseboard", boarded), ("moulding", moulded)):
        finish = "none" if strip is None else _finish(finishes, f"{room.name}-{key}", strip, 0)
        lines.append(f'{key} = "{finish}"')
    return "\n".join([*lines, "things = [", *(f"  {thing}," for thing in things), "]"])


def _has_strip(views: Sequence[WallView], up_m: tuple[float, float], beside_m: tuple[float, float]) -> Floats | None:
    """The colour of a strip along the walls that differs from the wall beside it; None where most have none."""
    strips, differ = [], 0
    for view in views:
        span = view.start_m, view.start_m + view.picture.shape[1] * PIXEL_M
        strip, wall = view.colour(span, up_m), view.colour(span, beside_m)
        if strip is not None and wall is not None:
            strips.append(strip)
            differ += bool(np.abs(strip - wall).max() > UNLIKE)
    return np.median(strips, axis=0) if strips and 2 * differ > len(strips) else None


def _format_boards(boards: Sequence[WallBoard], side: int, origin_m: float, name: str, finishes: dict[str, str]) -> str:
    middle, up = (0.5 * sum(ends) for ends in (boards[0].along_m, boards[0].up_m))
    out, boxes = OUTWARD[side], list[str]()
    right = (-out[1], out[0])[1 - ACROSS[side]]  # a box's x is to the right of who stands with the back to the wall
    for number, board in enumerate(boards):
        x = sorted(right * (end - middle) for end in board.along_m)
        z = [end - up for end in board.up_m]
        finish = _finish(finishes, f"{name}-{number}", board.colour, side)
        boxes.append(f"{{ x = [{x[0]:.3f}, {x[1]:.3f}], y = [0.0, {BOARD_DEPTH_M + 0.005 * number:.3f}], "
                     f'z = [{z[0]:.3f}, {z[1]:.3f}], finish = "{finish}" }}')
    return (f'{{ name = "{name}", wall = "{SIDES[side]}", along = {middle - origin_m:.3f}, up = {up:.3f}, '
            f"boxes = [{', '.join(boxes)}] }}")


def _format_door(
    built: AxisMap, door: LearntDoor, view: WallView, number: int, finishes: dict[str, str]
) -> str:
    room = built.rooms[door.room]
    ends = np.array([door.ends_m] if door.far_ends_m is None else [door.ends_m, door.far_ends_m])
    low, high = ends.mean(axis=0)
    height_m, frame = _measure_door(view, low, high)
    back = BASEBOARD_DEPTH_M
    start = (room.box[0] if ACROSS[door.side] == 1 else room.box[1]) - back
    finish = "none" if frame is None else _finish(finishes, f"door-{number}-frame", frame, door.side)
    return (f'door-{number} = {{ between = ["{door.room}", "{door.behind}"], wall = "{SIDES[door.side]}", '
            f"along = {0.5 * (low + high) - start:.3f}, width = {high - low:.3f}, height = {height_m:.3f}, "
            f'open = true, frame = "{finish}" }}')


def _measure_door(view: WallView, low: float, high: float) -> tuple[float, Floats | None]:
    """How high a doorway is, and the colour of the boards round it; None where they do not differ from the wall."""
    beside = [view.colour(along, (0.4, 1.6)) for along in (
        (low - CASING_WIDTH_M + 0.025, low - 0.025), (high + 0.025, high + CASING_WIDTH_M - 0.025))]
    boards = [colour for colour in beside if colour is not None]
    wall = view.colour((low - 0.6, low - 0.2), (0.4, 1.6))
    wall = view.colour((high + 0.2, high + 0.6), (0.4, 1.6)) if wall is None else wall
    frame = np.mean(boards, axis=0) if boards else None
    if frame is None or (wall is not None and np.abs(frame - wall).max() < UNLIKE):
        return 2.0, None
    columns = view.columns(low + 0.1, high - 0.1)
    like = (np.abs(view.picture[:, columns] - frame).max(axis=2) < UNLIKE) & view.seen[:, columns]
    share = like.mean(axis=1)
    rows = [r for r in range(int(1.8 / PIXEL_M), len(share) - 5) if share[r : r + 5].mean() > 0.6]
    return (rows[0] * PIXEL_M if rows else 2.0), frame


def _finish(finishes: dict[str, str], name: str, colour: Floats, side: int) -> str:
    """Note a finish that looks so in a picture; ``side`` -1 is the floor. Returns its name."""
    normal = np.array([0.0, 0.0, 1.0]) if side < 0 else -np.array([*OUTWARD[side], 0.0])
    light = GAIN * (AMBIENT + 0.25 * float(np.dot(LAMP_DIRECTION, normal)))
    parts = np.clip(colour / 255.0 / light, 0.0, 1.0)
    finishes[name] = f"{{ colour = {json.dumps([round(float(p), 3) for p in parts])} }}"
    return name
