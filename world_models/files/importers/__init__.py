"""Building files of other formats, made into world files: IFC and IndoorGML."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from world_models.files.importers.indoor_gml.network import Network
from world_models.files.importers.layout import Layout, lay_out
from world_models.files.importers.plan import Account, BuildingError, Plan
from world_models.files.importers.world_text import world_text

__all__ = ["FORMATS", "Account", "BuildingError", "ImportedBuilding", "Network", "import_building", "read_plan"]

FORMATS = (".ifc", ".gml", ".xml")


@dataclass(frozen=True, eq=False)
class ImportedBuilding:
    """A building as a world file: its text, how it was laid out, and the graph that came with it, where one did."""

    text: str
    layout: Layout
    network: Network | None

    @property
    def account(self) -> Account:
        """What was used of the file, guessed and left out."""
        return self.layout.plan.account


def import_building(path: Path) -> ImportedBuilding:
    """Read a building file and lay it out as a world. Raises BuildingError where that cannot be."""
    plan, network = read_plan(path)
    layout = lay_out(plan)
    return ImportedBuilding(world_text(layout), layout, network)


def read_plan(path: Path) -> tuple[Plan, Network | None]:
    """What is in a building file, and the graph to plan on where it has one. Raises BuildingError."""
    if path.suffix.lower() not in FORMATS:
        raise BuildingError(f"{path.name}: expected a building file that ends in {', '.join(FORMATS)}")
    if not path.is_file():
        raise BuildingError(f"{path}: expected a building file, got none there")
    if path.suffix.lower() == ".ifc":
        from world_models.files.importers.ifc.read_ifc import read_ifc

        return read_ifc(path), None
    from world_models.files.importers.indoor_gml.read_indoor_gml import read_indoor_gml

    return read_indoor_gml(path)
