"""Generated floors: corridors with furnished rooms on both sides, the same for the same seed.

A floor is the text of a world file, in feet, made of the finishes and parts that the project's worlds share; its
details are what the building has and the model lacks. With ``symmetric`` every corridor looks the same from both ends:
doors, boards and pictures are point-symmetric about its middle, and so is the light that they reflect. With
``repeated`` all rooms have the same width, and all doors are alike.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from sim.differences.inexact import TrueInexact, displace
from sim.made_up.floor_plan import FloorPlan
from sim.made_up.generated_floors_text import as_toml
from world_models.building.world import World
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world


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

    def displaced(self, truth: TrueInexact) -> World:
        """The building, with its details, as inexactly as the model describes it."""
        details = Source.parse(self.details, f"floor-{self.seed}-details")
        return read_world(Source.parse(self.text, f"floor-{self.seed}"), [details],
                          altered=lambda spec: displace(spec, truth).spec)

    def write(self, folder: Path) -> tuple[Path, Path]:
        """Write the files of the model and of the details, for scenarios."""
        world, details = folder / f"floor-{self.seed}.toml", folder / f"floor-{self.seed}-details.toml"
        world.write_text(self.text, "utf-8")
        details.write_text(self.details, "utf-8")
        return world, details


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
