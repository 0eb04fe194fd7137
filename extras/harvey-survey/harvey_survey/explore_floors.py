"""Floors to explore, drawn at random, with open doors and bare rooms; and how like the truth a model is.

A model is laid into the world's frame by the place where the robot was put down, as it knows no other.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.generated.floor_plan import as_toml
from experiments.generated.floors import generated_floor
from world_models.building.world import World
from world_models.frames import Pose2

Floats = NDArray[np.float64]

STANDING = ("desk", "bookshelf", "file-cabinet", "cupboard", "rack", "table")
"""What stands on the floor, and is left out."""
SAME_ROOM, SAME_DOOR_M, SAME_CORNER_M = 0.7, 0.3, 0.1
"""A room is found whose outline shares so much with the true one, a doorway whose middle is so near, a corner."""


def write_bare_floor(folder: Path, seed: int, rooms: int) -> Path:
    """Write a floor with so many rooms along corridors; returns the world file."""
    data = tomllib.loads(generated_floor(seed, rooms, open_share=1.0, clutter=0.0).text)
    for locale in data["locales"].values():
        if "things" in locale:
            locale["things"] = [thing for thing in locale["things"] if thing["part"] not in STANDING]
    path = folder / f"bare-{seed}.toml"
    path.write_text(as_toml(data), "utf-8")
    return path


def lay_into_world(learnt: Path, start: Pose2, start_rad: float) -> Path:
    """Write the model in the world's frame; ``start_rad`` is the robot's heading at the start, in the model's."""
    x, y = start.x_m, start.y_m
    path = learnt.with_name(f"{learnt.stem}-in-world.toml")
    path.write_text(f'name = "{learnt.stem}"\nunits = "metres"\n[locales.explored]\nkind = "building"\n'
                    f'from = "{learnt.name}"\nat = [{x:.5f}, {y:.5f}]\n'
                    f"turn = {math.degrees(start.heading_rad - start_rad):.5f}\n", "utf-8")
    return path


@dataclass(frozen=True, slots=True)
class Likeness:
    """How like the truth a model is.

    Attributes:
        rooms, found_rooms, false_rooms; doors, found_doors, false_doors: how many.
        walls_m: how far each wall of a room that was found is off, along its normal; angle_deg: of the axes.
        own_right, own_corners; true_found, true_corners: of the model's corners how many are near a true one, and of
            the true ones how many near one of the model's.
    """

    rooms: int
    found_rooms: int
    false_rooms: int
    doors: int
    found_doors: int
    false_doors: int
    walls_m: list[float]
    angle_deg: float
    own_right: int
    own_corners: int
    true_found: int
    true_corners: int


def compare_models(true: World, learnt: World) -> Likeness:
    """A model, in the world's frame, beside the truth."""
    pairs = match_rooms(true, learnt)
    walls = [off for name, own in pairs.items() for off in _measure_walls(true.outline(name), learnt.outline(own))]
    first, second = learnt.outline(learnt.rooms[0])[:2]
    angle = math.degrees(math.atan2(*(second - first)[::-1]))
    true_corners = np.concatenate([true.outline(name) for name in true.rooms])
    own_corners = np.concatenate([learnt.outline(name) for name in learnt.rooms])
    doors = [door.centre_world for door in true.doorways]
    own_doors = [door.centre_world for door in learnt.doorways]
    found = sum(_near(door, own_doors, SAME_DOOR_M) for door in doors)
    false = sum(not _near(door, doors, SAME_DOOR_M) for door in own_doors)
    return Likeness(
        len(true.rooms), len(pairs), len(learnt.rooms) - len(pairs), len(doors), found, false, walls,
        abs(math.remainder(angle, 90.0)),
        sum(_near(corner, true_corners, SAME_CORNER_M) for corner in own_corners), len(own_corners),
        sum(_near(corner, own_corners, SAME_CORNER_M) for corner in true_corners), len(true_corners))


def match_rooms(true: World, learnt: World) -> dict[str, str]:
    """Each true room that was found, with its name in the model."""
    pairs = {}
    for name in true.rooms:
        shares = {own: _share(true.outline(name), learnt.outline(own)) for own in learnt.rooms}
        best = max(shares, key=lambda own: shares[own], default="")
        if best and shares[best] >= SAME_ROOM:
            pairs[name] = best
    return pairs


def sample_floor(true: World, step_m: float = 0.1, margin_m: float = 0.1) -> Floats:
    """(n, 2) points of the floor of all rooms [m, world]."""
    points = []
    for name in true.rooms:
        low, high = true.outline(name).min(axis=0) + margin_m, true.outline(name).max(axis=0) - margin_m
        x, y = np.arange(low[0], high[0], step_m), np.arange(low[1], high[1], step_m)
        points.append(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
    return np.concatenate(points)


def _share(one: Floats, other: Floats) -> float:
    """Intersection over union of the boxes round two outlines."""
    low = np.maximum(one.min(axis=0), other.min(axis=0))
    high = np.minimum(one.max(axis=0), other.max(axis=0))
    both = float(np.prod(np.maximum(high - low, 0.0)))
    area = float(np.prod(np.ptp(one, axis=0)) + np.prod(np.ptp(other, axis=0)))
    return both / (area - both)


def _measure_walls(true: Floats, own: Floats) -> list[float]:
    ends = np.stack([true.min(axis=0), true.max(axis=0)]) - np.stack([own.min(axis=0), own.max(axis=0)])
    return [float(end) for end in np.abs(ends).ravel()]


def _near(point: Floats, others: Sequence[Floats] | Floats, within_m: float) -> bool:
    return len(others) > 0 and float(np.linalg.norm(np.asarray(others) - point, axis=1).min()) <= within_m
