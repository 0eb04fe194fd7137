"""Generated floors: corridors with furnished rooms on both sides, the same for the same seed.

A floor is the text of a world file, in feet, made of the finishes and parts that the project's worlds share; its
details are what the building has and the model lacks. With ``symmetric`` every corridor looks the same from both ends:
doors, boards and pictures are point-symmetric about its middle, and so is the light that they reflect. With
``repeated`` all rooms have the same width, and all doors are alike.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from experiments.generated.floor_plan import DEEP, FloorPlan, as_toml
from world_models.building.world import World
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world

FLOOR_TEXTURES: Mapping[str, float] = {"plain": 1.0, "speckle": 0.3, "carpet": 0.1, "tiles": 1.0, "wood": 0.3}
"""Textures of drawn floors, with the size of their cells [ft]."""
DRAWN_FLOOR = "drawn-floor"
SURFACES: Mapping[str, tuple[float, float]] = {
    "plain": (1.0, 1.0), "speckle": (0.15, 0.4), "carpet": (0.1, 0.3), "wood": (0.2, 0.8), "brick": (0.4, 1.2),
    "tiles": (0.4, 2.5), "stripes": (0.5, 2.0), "poster": (1.0, 3.0)}
"""Textures of surfaces that no plan tells of, with the least and the largest size of their cells [ft]."""
STANDING = (*DEEP, "table")
"""What stands on the floor."""
NOT_DRAWN = "unknown"
"""The finish of all that a plan says nothing of."""


def draw_colour(rng: np.random.Generator) -> list[float]:
    """Red, green and blue of a floor, from grey to strongly coloured."""
    grey, tint = rng.uniform(0.25, 0.7), rng.normal(0.0, 0.06, 3)
    return [round(float(part), 3) for part in np.clip(grey * (1.0 + 3.0 * (tint - tint.mean())), 0.08, 0.9)]


@dataclass(frozen=True, eq=False)
class Floor:
    """A generated floor.

    Attributes:
        seed: of its random numbers.
        text: the world file.
        details: the file of what the building has and the model lacks.
        corridors, rooms: names of its locales.
    """

    seed: int
    text: str
    details: str
    corridors: tuple[str, ...]
    rooms: tuple[str, ...]

    @cached_property
    def world(self) -> World:
        """The model."""
        return read_world(Source.parse(self.text, f"floor-{self.seed}"))

    @cached_property
    def building(self) -> World:
        """The model with the details that it lacks."""
        return self.altered(0.0)

    def altered(self, missing: float, rng: np.random.Generator | None = None) -> World:
        """The building without a random share (0..1) of the model's things."""
        data = tomllib.loads(self.text)
        if missing > 0.0:
            chance = rng if rng is not None else np.random.default_rng([self.seed, 1])
            for locale in data["locales"].values():
                if "things" in locale:
                    locale["things"] = [thing for thing in locale["things"] if chance.random() >= missing]
        details = Source.parse(self.details, f"floor-{self.seed}-details")
        return read_world(Source.parse(as_toml(data), f"floor-{self.seed}"), [details])

    @property
    def floor_colour(self) -> tuple[float, ...]:
        """Of a floor that was drawn."""
        return tuple(tomllib.loads(self.text)["finishes"][DRAWN_FLOOR]["colour"])

    def refloored(self, rng: np.random.Generator) -> Floor:
        """The same with floors of one finish, which is drawn."""
        data = tomllib.loads(self.text)
        scale, colour = FLOOR_TEXTURES[texture := str(rng.choice(list(FLOOR_TEXTURES)))], draw_colour(rng)
        data["finishes"][DRAWN_FLOOR] = {"colour": colour, "texture": texture, "scale": scale}
        for locale in data["locales"].values():
            if "floor" in locale:
                locale["floor"] = DRAWN_FLOOR
        return replace(self, text=as_toml(data))

    @property
    def plan(self) -> Floor:
        """The same as a floor plan has it: no colours, no baseboards and no mouldings."""
        data = _without_trim(self.text)
        data["finishes"] = {name: {"colour": NOT_DRAWN} for name in data["finishes"]}
        return replace(self, text=as_toml(data))

    @property
    def grey(self) -> Floor:
        """The same with doors that are alike and surfaces in one grey: what of it a plan can tell apart."""
        data = _without_trim(self.text)
        boxes = [box for part in data["parts"].values() for box in part]
        parts = {box[key] for box in boxes for key in ("finish", "rim") if key in box}
        data["finishes"] = {name: finish if name in parts else {"colour": [0.6, 0.6, 0.6]}
                            for name, finish in data["finishes"].items()}
        data["doors"] = {name: {key: value for key, value in door.items() if key not in ("frame", "leaf")}
                         for name, door in data["doors"].items()}
        return replace(self, text=as_toml(data))

    def textured(self, rng: np.random.Generator) -> Floor:
        """The same with tiles, bricks, planks and the like on walls, floors and ceilings, as they are drawn.

        Half of the ceilings are of the walls' finish, so that no edge is seen between them.
        """
        data = _without_trim(self.text)
        for name, locale in data["locales"].items():
            if "size" not in locale:
                continue
            for part in ("walls", "floor", "ceiling"):
                texture = str(rng.choice(list(SURFACES)))
                data["finishes"][finish := f"{part}-of-{name}"] = {
                    "colour": draw_colour(rng), "texture": texture, "scale": round(rng.uniform(*SURFACES[texture]), 2)}
                locale[part] = finish
            if rng.random() < 0.5:
                locale["ceiling"] = locale["walls"]
        return replace(self, text=as_toml(data))

    @property
    def bare(self) -> Floor:
        """The floor without what stands on it."""
        data = tomllib.loads(self.text)
        for locale in data["locales"].values():
            if "things" in locale:
                locale["things"] = [thing for thing in locale["things"] if thing["part"] not in STANDING]
        return replace(self, text=as_toml(data))

    def write(self, folder: Path) -> tuple[Path, Path]:
        """Write the files of the model and of the details, for scenarios."""
        world, details = folder / f"floor-{self.seed}.toml", folder / f"floor-{self.seed}-details.toml"
        world.write_text(self.text, "utf-8")
        details.write_text(self.details, "utf-8")
        return world, details


def _without_trim(text: str) -> dict[str, Any]:
    data = tomllib.loads(text)
    for table in (data["defaults"], *data["locales"].values()):
        for name in ("baseboard", "moulding"):
            table.pop(name, None)
    return data


def generated_floor(
    seed: int, rooms: int = 12, *, symmetric: bool = False, repeated: bool = False, open_share: float = 0.5,
    clutter: float = 1.0, joined: bool = False, identical: bool = False,
) -> Floor:
    """Generate a floor, the same for the same arguments.

    Args:
        rooms: number of rooms.
        symmetric: every corridor looks the same from both ends; its doors are closed.
        repeated: all doors are alike and at the same distance from each other.
        open_share: share of the doors that is open.
        clutter: amount of things that the model lacks; 1 is about as in the Research Center.
        identical: all rooms are alike, also in what stands in them; implies ``repeated``.
        joined: doors join neighbouring rooms too, so that there is more than one way.

    Raises:
        ValueError: fewer than 2 rooms, or a share outside 0..1.
    """
    if rooms < 2 or not 0.0 <= open_share <= 1.0 or clutter < 0.0:
        raise ValueError(f"expected at least 2 rooms, 0 <= open_share <= 1 and clutter >= 0, "
                         f"got {rooms}, {open_share} and {clutter}")
    plan = FloorPlan(np.random.default_rng(seed), symmetric, repeated or identical, 0.0 if symmetric else open_share,
                     joined, identical)
    plan.lay_out(rooms)
    return Floor(seed, plan.format_world(seed), plan.format_details(clutter), tuple(plan.corridors), tuple(plan.rooms))
