"""From an opened IFC file to a plan: which spaces there are, what joins them, and what stands in them."""

from __future__ import annotations

from world_models.files.importers.ifc.contents import FURNITURE, Contents
from world_models.files.importers.ifc.opened_file import ELEMENT_S, IfcFile, Next
from world_models.files.importers.ifc.passages import Passages
from world_models.files.importers.ifc.spaces import Spaces
from world_models.files.importers.plan import Plan


def plan_of(file: IfcFile) -> Plan:
    """Everything that is used of the file. Raises BuildingError where it has no space that can be used."""
    file.tell(Next("reading its storeys", ELEMENT_S))
    spaces, contents = Spaces(file), Contents(file)
    spaces.read()
    Passages(file, spaces).read()
    contents.read()
    _tell(file, contents)
    return file.plan


def _tell(file: IfcFile, contents: Contents) -> None:
    """The account of what was used and left out."""
    plan, account = file.plan, file.plan.account

    def count(*kinds: str) -> int:
        return len(file.all(*kinds))

    doors = len([gap for gap in plan.gaps if gap.has_leaf])
    passages = f"{len(plan.gaps) - doors} openings without a door, " if len(plan.gaps) > doors else ""
    account.used.append(f"{file.model.schema}: {len(plan.storeys)} storeys, {len(plan.spaces)} of "
                        f"{count('IfcSpace')} spaces, {doors} of {count('IfcDoor')} doors, {passages}"
                        f"{len(plan.windows)} of {count('IfcWindow')} windows, {contents.flights} of "
                        f"{contents.told} stairs, {contents.pieces} of {count(*FURNITURE)} pieces of furniture")
    if lifts := count("IfcTransportElement"):
        account.used.append(f"{lifts} lifts: {len(contents.lifts)} rides from a storey to the next")
    account.used.append(f"its unit of length: {file.unit_m:g} m")
    account.used.append("which spaces a door joins: from space boundaries, and from what lies on both its sides")
    account.guessed.append("all doors between spaces stand open; furniture is its bounding box; colours are ours")
    account.left_out.append(f"the shapes of {count('IfcWall')} walls (rooms are bounded by their spaces), "
                            "slabs, coverings, roofs, railings, materials")
