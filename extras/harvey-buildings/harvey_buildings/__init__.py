"""How does a building of another program become a world file, and a world a file of theirs?

In reading order:

* :mod:`.buildings_commands`: ``harvey world import`` and ``harvey world export``.
* :mod:`.importing`: the reader of a file's ending, and from its plan to a world file.
* :mod:`.building_plan`: what a building file contains: spaces, openings, furnishings, and a report of what was used.
* :mod:`.geojson`: GeoJSON read and written.
* :mod:`.indoor_gml`: IndoorGML (OGC 14-005, and 2.0's core) read; :mod:`.indoor_gml_file` has its elements.
* :mod:`.ifc`: IFC (ISO 16739) read, in a process of its own; :mod:`.ifc_file` has the opened file, :mod:`.ifc_elements`
  what its elements are on the plan.
* :mod:`.ros_map`: a ROS map read; :mod:`.ros_map_file` has its files, which are written too, :mod:`.ros_map_rooms` its
  floor parted into rooms, at doorways and at wide openings (:mod:`.ros_map_openings`).
* :mod:`.polygons`: outlines cleaned, kept apart by walls, and straightened at doors.
* :mod:`.placement`: doors, wide openings and windows placed in walls, furniture and stairs fitted into rooms.
* :mod:`.layout`: rooms with walls, openings and furniture in place.
* :mod:`.world_text`: the world file.
* :mod:`.exporters`: a world for other programs: ROS map, SVG, GeoJSON, glTF.

Other packages add formats by entry points: ``harvey.importers``, an :class:`Importer` under the ending of its files,
and ``harvey.exporters``, an ``Exporter`` (:mod:`.exporters`) under the ending or the name of its format.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from harvey_buildings.building_plan import BuildingError, ImportReport, NavigationGraph
    from harvey_buildings.importing import ImportedBuilding, Importer, import_building, read_plan

__all__ = ["BuildingError", "ImportReport", "ImportedBuilding", "Importer", "NavigationGraph", "import_building",
           "read_plan"]


def __getattr__(name: str) -> Any:
    """Names are loaded when they are first used: ``harvey --help`` needs none of them."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.importing"), name)
