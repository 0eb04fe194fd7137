"""How does a building of another program become a world file, and a world a file of theirs?

In reading order:

* :mod:`.buildings_commands`: ``harvey world import`` and ``harvey world export``.
* :mod:`.importing`: the reader of a file's ending, and from its plan to a world file.
* :mod:`.formats`: the files of other programs. GeoJSON, IFC (in a process of its own), IndoorGML, ROS maps.
* :mod:`.fitting`: from the plan that they say, spaces, openings and furnishings, to rooms with all in place.
* :mod:`.world_text`: the world file.
* :mod:`.exporters`: a world for other programs: ROS map, SVG, GeoJSON, glTF.

Other packages add formats by entry points: ``harvey.importers``, an :class:`Importer` under the ending of its files,
and ``harvey.exporters``, an ``Exporter`` (:mod:`.exporters`) under the ending or the name of its format.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from harvey_buildings.fitting.building_plan import BuildingError, ImportReport, NavigationGraph
    from harvey_buildings.importing import ImportedBuilding, Importer, import_building, read_plan

__all__ = ["BuildingError", "ImportReport", "ImportedBuilding", "Importer", "NavigationGraph", "import_building",
           "read_plan"]


def __getattr__(name: str) -> Any:
    """Names are loaded when they are first used: ``harvey --help`` needs none of them."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.importing"), name)
