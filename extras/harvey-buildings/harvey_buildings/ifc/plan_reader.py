"""From an opened IFC file to a building plan, with the report of what was used, guessed and left out."""

from __future__ import annotations

from harvey_buildings.building_plan import BuildingPlan
from harvey_buildings.ifc.contents import FURNITURE, Contents
from harvey_buildings.ifc.opened_file import ELEMENT_S, IfcFile, Progress
from harvey_buildings.ifc.passages import Passages
from harvey_buildings.ifc.spaces import Spaces


def read_plan(file: IfcFile) -> BuildingPlan:
    """Everything that is used of the file. Raises BuildingError where it has no usable space."""
    file.send(Progress("reading its storeys", ELEMENT_S))
    spaces, contents = Spaces(file), Contents(file)
    spaces.read()
    Passages(file, spaces).read()
    contents.read()
    _write_report(file, contents)
    return file.plan


def _write_report(file: IfcFile, contents: Contents) -> None:
    """Say what was used, guessed and left out."""
    plan, report = file.plan, file.plan.report

    def count(*kinds: str) -> int:
        return len(file.all(*kinds))

    doors = len([gap for gap in plan.openings if gap.has_leaf])
    passages = f"{len(plan.openings) - doors} openings without a door, " if len(plan.openings) > doors else ""
    report.used.append(f"{file.model.schema}: {len(plan.storeys)} storeys, {len(plan.spaces)} of "
                        f"{count('IfcSpace')} spaces, {doors} of {count('IfcDoor')} doors, {passages}"
                        f"{len(plan.windows)} of {count('IfcWindow')} windows, {contents.flights} of "
                        f"{contents.stairs} stairs, {contents.pieces} of {count(*FURNITURE)} pieces of furniture")
    if lifts := count("IfcTransportElement"):
        report.used.append(f"{lifts} lifts: {len(contents.lifts)} rides from a storey to the next")
    report.used.append(f"its unit of length: {file.unit_m:g} m")
    report.used.append("which spaces a door joins: from space boundaries, and from what lies on both its sides")
    report.guessed.append("all doors between spaces stand open; furniture is its bounding box; colours are ours")
    report.left_out.append(f"the shapes of {count('IfcWall')} walls (rooms are bounded by their spaces), "
                            "slabs, coverings, roofs, railings, materials")
