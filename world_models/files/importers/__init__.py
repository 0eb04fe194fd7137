"""How does a building file of another format become a world file? IFC, IndoorGML, GeoJSON and ROS maps.

In reading order:

* :mod:`.building_plan`: what a building file contains: spaces, openings, furnishings, and a report of what was used.
* :mod:`.indoor_gml`, :mod:`.ifc`, :mod:`.geojson`, :mod:`.ros_map`: the readers, each into a building plan.
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
from world_models.files.importers.ros_map.occupancy import PICTURES, explain_bare_picture
from world_models.files.importers.world_text import world_text

__all__ = ["FORMATS", "BuildingError", "ImportReport", "ImportedBuilding", "NavigationGraph", "import_building",
           "read_plan"]

MAPS = (".yaml", ".yml")
FEATURES = (".geojson", ".json")
FORMATS = (".ifc", ".gml", ".xml", *FEATURES, *MAPS)


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


def import_building(path: Path, wall_height_m: float | None = None) -> ImportedBuilding:
    """Read a building file and lay it out as a world. Raises BuildingError where it cannot be read.

    ``wall_height_m``: of a ROS map, which has no heights.
    """
    plan, network = read_plan(path, wall_height_m)
    layout = lay_out(plan)
    return ImportedBuilding(world_text(layout), layout, network)


def read_plan(path: Path, wall_height_m: float | None = None) -> tuple[BuildingPlan, NavigationGraph | None]:
    """The building plan of a file, and its navigation graph where it has one. Raises BuildingError."""
    if path.suffix.lower() in PICTURES:
        raise BuildingError(explain_bare_picture(path))
    if path.suffix.lower() not in FORMATS:
        raise BuildingError(f"{path.name}: expected a building file that ends in {', '.join(FORMATS)}")
    if not path.is_file():
        raise BuildingError(f"{path}: expected a building file, got none there")
    is_map = path.suffix.lower() in MAPS
    if wall_height_m is not None and not is_map:
        raise BuildingError(f"{path.name}: expected no wall height, as only a ROS map ({', '.join(MAPS)}) has none")
    if path.suffix.lower() == ".ifc":
        from world_models.files.importers.ifc.read_ifc import read_ifc

        return read_ifc(path), None
    if is_map:
        from world_models.files.importers.ros_map.read_ros_map import WALL_HEIGHT_M, read_ros_map

        return read_ros_map(path, WALL_HEIGHT_M if wall_height_m is None else wall_height_m), None
    if path.suffix.lower() in FEATURES:
        from world_models.files.importers.geojson.read_geojson import read_geojson

        return read_geojson(path), None
    from world_models.files.importers.indoor_gml.read_indoor_gml import read_indoor_gml

    return read_indoor_gml(path)
