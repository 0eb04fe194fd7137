"""Which reader reads a building file, and how does what it read become a world file?"""

from __future__ import annotations

from dataclasses import dataclass
from inspect import signature
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from harvey_buildings.fitting.building_plan import BuildingError, BuildingPlan, ImportReport, NavigationGraph
from harvey_buildings.fitting.layout import Layout, lay_out
from harvey_buildings.formats.ros_map_file import PICTURES, explain_bare_picture
from harvey_buildings.world_text import world_text
from world_models.building.checks import Watched, pass_on
from world_models.plugins import list_plugins, load_plugins

GROUP = "harvey.importers"


@runtime_checkable
class Importer(Protocol):
    """Reads a building file. Raises BuildingError.

    One that has a parameter ``wall_height_m`` may be given that, and one with ``watched`` shows by it how far it is.
    """

    def __call__(self, path: Path, /) -> BuildingPlan:
        """The plan of the file."""


@dataclass(frozen=True, eq=False)
class ImportedBuilding:
    """A building as a world file: its text, its layout, and the navigation graph of the file, where it has one."""

    text: str
    layout: Layout
    network: NavigationGraph | None

    @property
    def report(self) -> ImportReport:
        """What was used of the file, what was guessed and what was left out."""
        return self.layout.plan.report


def import_building(path: Path, wall_height_m: float | None = None, watched: Watched = pass_on) -> ImportedBuilding:
    """Read a building file and lay it out as a world. Raises BuildingError where it cannot be read.

    ``wall_height_m``: of a ROS map, which has no heights; ``watched`` may show the progress: a large one takes minutes.
    """
    plan, network = read_plan(path, wall_height_m, watched)
    layout = lay_out(plan, watched)
    return ImportedBuilding(world_text(layout), layout, network)


def read_plan(
    path: Path, wall_height_m: float | None = None, watched: Watched = pass_on,
) -> tuple[BuildingPlan, NavigationGraph | None]:
    """The building plan of a file, and its navigation graph where it has one. Raises BuildingError."""
    ending = path.suffix.lower()
    if ending in PICTURES:
        raise BuildingError(explain_bare_picture(path))
    formats = [f".{name}" for name in list_plugins(GROUP)]
    if ending not in formats:
        raise BuildingError(f"{path.name}: expected a building file that ends in {', '.join(formats)}")
    if not path.is_file():
        raise BuildingError(f"{path}: expected a building file, got none there")
    importer = load_plugins(GROUP, Importer, ending[1:])[ending[1:]]
    known = signature(importer).parameters
    if wall_height_m is not None and "wall_height_m" not in known:
        raise BuildingError(f"{path.name}: expected no wall height, as only a ROS map (.yaml, .yml) has none")
    more: dict[str, Any] = {"watched": watched} if "watched" in known else {}
    plan: BuildingPlan = importer(path, **more) if wall_height_m is None else importer(
        path, wall_height_m=wall_height_m, **more)
    return plan, plan.network
