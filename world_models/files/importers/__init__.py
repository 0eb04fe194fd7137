"""How does a building file of another format become a world file? IFC and IndoorGML.

In reading order:

* :mod:`.building_plan`: what a building file contains: spaces, openings, furnishings, and a report of what was used.
* :mod:`.indoor_gml`, :mod:`.ifc`: the readers, each into a building plan.
* :mod:`.polygons`, :mod:`.curved_walls`: outlines cleaned, kept apart by walls, and straightened at doors.
* :mod:`.openings`: positions of doors, wide openings and windows in walls.
* :mod:`.furnishings`: furniture and stairs fitted into rooms.
* :mod:`.layout`: rooms with walls, openings and furniture in place.
* :mod:`.world_text`: the world file.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from world_models.files.importers.building_plan import BuildingError, BuildingPlan, ImportReport
from world_models.files.importers.indoor_gml.navigation_graph import NavigationGraph
from world_models.files.importers.layout import Layout, lay_out
from world_models.files.importers.world_text import world_text

__all__ = ["FORMATS", "BuildingError", "ImportReport", "ImportedBuilding", "NavigationGraph", "import_building",
           "read_plan"]

FORMATS = (".ifc", ".gml", ".xml")


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


def import_building(path: Path) -> ImportedBuilding:
    """Read a building file and lay it out as a world. Raises BuildingError where it cannot be read."""
    plan, network = read_plan(path)
    layout = lay_out(plan)
    return ImportedBuilding(world_text(layout), layout, network)


def read_plan(path: Path) -> tuple[BuildingPlan, NavigationGraph | None]:
    """The building plan of a file, and its navigation graph where it has one. Raises BuildingError."""
    if path.suffix.lower() not in FORMATS:
        raise BuildingError(f"{path.name}: expected a building file that ends in {', '.join(FORMATS)}")
    if not path.is_file():
        raise BuildingError(f"{path}: expected a building file, got none there")
    if path.suffix.lower() == ".ifc":
        from world_models.files.importers.ifc.read_ifc import read_ifc

        return read_ifc(path), None
    from world_models.files.importers.indoor_gml.read_indoor_gml import read_indoor_gml

    return read_indoor_gml(path)
