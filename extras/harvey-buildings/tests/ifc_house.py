"""Small houses as IFC files, written as different programs write them, for the tests of the importer."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

Points = Sequence[tuple[float, float]]
FOOT_M = 0.3048


def box(x0: float, y0: float, x1: float, y1: float) -> Points:
    """The corners of a rectangle [m]."""
    return (x0, y0), (x1, y0), (x1, y1), (x0, y1)


@dataclass
class House:
    """An IFC file in the making; all that is asked for is in metres, whatever the file's unit is.

    Attributes:
        schema: IFC2X3 or IFC4.
        unit: metre, millimetre, foot, or none: the file then says nothing of its unit, and has metres.
        at: x, y, z of the site [m] and its turn [degrees].
    """

    schema: str = "IFC4"
    unit: str = "metre"
    at: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    file: Any = field(init=False)
    storeys: list[Any] = field(default_factory=list)
    count: int = 0

    def __post_init__(self) -> None:
        import ifcopenshell

        self.file = ifcopenshell.file(schema=self.schema)
        owner = {}
        if self.schema == "IFC2X3":
            person = self.make("IfcPerson", FamilyName="a")
            firm = self.make("IfcOrganization", Name="a")
            both = self.make("IfcPersonAndOrganization", ThePerson=person, TheOrganization=firm)
            tool = self.make("IfcApplication", ApplicationDeveloper=firm, Version="1", ApplicationFullName="a",
                             ApplicationIdentifier="a")
            owner = {"OwnerHistory": self.make("IfcOwnerHistory", OwningUser=both, OwningApplication=tool,
                                               ChangeAction="ADDED", CreationDate=0)}
        self._owner = owner
        self.context = self.make("IfcGeometricRepresentationContext", ContextType="Model", CoordinateSpaceDimension=3,
                                 Precision=1e-5, WorldCoordinateSystem=self._axes((0.0, 0.0, 0.0)))
        units = None if self.unit == "none" else self.make("IfcUnitAssignment", Units=[self._length()])
        self.project = self.rooted("IfcProject", "project", RepresentationContexts=[self.context], UnitsInContext=units)
        x, y, z, turn = self.at
        self.site = self.rooted("IfcSite", "site", ObjectPlacement=self.place((x, y, z), turn))
        self.building = self.rooted("IfcBuilding", "building", ObjectPlacement=self.place(above=self.site))
        self.aggregate(self.project, self.site)
        self.aggregate(self.site, self.building)

    # -- the parts of a file -----------------------------------------------------------------------------------------

    def make(self, kind: str, *values: Any, **named: Any) -> Any:
        return self.file.create_entity(kind, *values, **named)

    def rooted(self, kind: str, name: str | None, **values: Any) -> Any:
        self.count += 1
        return self.make(kind, GlobalId=f"{self.count:022d}", Name=name, **self._owner, **values)

    def _length(self) -> Any:
        if self.unit == "foot":
            metre = self.make("IfcSIUnit", UnitType="LENGTHUNIT", Name="METRE")
            factor = self.make("IfcMeasureWithUnit", ValueComponent=self.make("IfcLengthMeasure", FOOT_M),
                               UnitComponent=metre)
            size = self.make("IfcDimensionalExponents", 1, 0, 0, 0, 0, 0, 0)
            return self.make("IfcConversionBasedUnit", Dimensions=size, UnitType="LENGTHUNIT", Name="FOOT",
                             ConversionFactor=factor)
        prefix = "MILLI" if self.unit == "millimetre" else None
        return self.make("IfcSIUnit", UnitType="LENGTHUNIT", Prefix=prefix, Name="METRE")

    def n(self, metres: float) -> float:
        """A length in the file's unit."""
        return float(metres) / {"foot": FOOT_M, "millimetre": 1e-3}.get(self.unit, 1.0)

    def point(self, *values: float) -> Any:
        return self.make("IfcCartesianPoint", [self.n(v) for v in values])

    def _axes(self, at: Sequence[float], turn_deg: float = 0.0) -> Any:
        turn = math.radians(turn_deg)
        return self.make("IfcAxis2Placement3D", Location=self.point(*at),
                         Axis=self.make("IfcDirection", [0.0, 0.0, 1.0]),
                         RefDirection=self.make("IfcDirection", [math.cos(turn), math.sin(turn), 0.0]))

    def place(self, at: Sequence[float] = (0.0, 0.0, 0.0), turn_deg: float = 0.0, above: Any = None) -> Any:
        return self.make("IfcLocalPlacement", RelativePlacement=self._axes(at, turn_deg),
                         PlacementRelTo=above.ObjectPlacement if above is not None else None)

    def aggregate(self, above: Any, *parts: Any) -> None:
        self.rooted("IfcRelAggregates", None, RelatingObject=above, RelatedObjects=list(parts))

    def contain(self, above: Any, *parts: Any) -> None:
        self.rooted("IfcRelContainedInSpatialStructure", None, RelatingStructure=above, RelatedElements=list(parts))

    # -- shapes ------------------------------------------------------------------------------------------------------

    def profile(self, corners: Points, *holes: Points) -> Any:
        rings = [self._ring(points) for points in (corners, *holes)]
        if holes:
            return self.make("IfcArbitraryProfileDefWithVoids", ProfileType="AREA", OuterCurve=rings[0],
                             InnerCurves=rings[1:])
        return self.make("IfcArbitraryClosedProfileDef", ProfileType="AREA", OuterCurve=rings[0])

    def _ring(self, corners: Points) -> Any:
        return self.make("IfcPolyline", [self.point(*c) for c in (*corners, corners[0])])

    def circle(self, x: float, y: float, radius: float) -> Any:
        middle = self.make("IfcAxis2Placement2D", Location=self.point(x, y))
        return self.make("IfcCircleProfileDef", ProfileType="AREA", Position=middle, Radius=self.n(radius))

    def extruded(self, profile: Any, low: float, height: float) -> Any:
        return self.make("IfcExtrudedAreaSolid", SweptArea=profile, Position=self._axes((0.0, 0.0, low)),
                         ExtrudedDirection=self.make("IfcDirection", [0.0, 0.0, 1.0]), Depth=self.n(height))

    def brep(self, corners: Points, low: float, height: float) -> Any:
        """A prism by its faces."""
        def face(ring: Sequence[tuple[float, float, float]]) -> Any:
            loop = self.make("IfcPolyLoop", [self.point(*p) for p in ring])
            return self.make("IfcFace", [self.make("IfcFaceOuterBound", Bound=loop, Orientation=True)])
        under, over = ([(x, y, z) for x, y in corners] for z in (low, low + height))
        count = len(corners)
        sides = [[under[i], under[(i + 1) % count], over[(i + 1) % count], over[i]] for i in range(count)]
        shell = self.make("IfcClosedShell", [face(ring) for ring in (under[::-1], over, *sides)])
        return self.make("IfcFacetedBrep", Outer=shell)

    def shape(self, *items: Any, kind: str = "SweptSolid", called: str = "Body") -> Any:
        body = self.make("IfcShapeRepresentation", ContextOfItems=self.context, RepresentationIdentifier=called,
                         RepresentationType=kind, Items=list(items))
        return self.make("IfcProductDefinitionShape", Representations=[body])

    def mapped(self, solid: Any) -> Any:
        shape = self.shape(solid).Representations[0]
        origin = self.make("IfcRepresentationMap", MappingOrigin=self._axes((0.0, 0.0, 0.0)),
                           MappedRepresentation=shape)
        target = self.make("IfcCartesianTransformationOperator3D", LocalOrigin=self.point(0.0, 0.0, 0.0))
        item = self.make("IfcMappedItem", MappingSource=origin, MappingTarget=target)
        return self.shape(item, kind="MappedRepresentation")

    # -- what a house has --------------------------------------------------------------------------------------------

    def storey(self, name: str | None, height: float, elevation: float | None = None) -> Any:
        told = height if elevation is None else elevation
        made = self.rooted("IfcBuildingStorey", name, Elevation=self.n(told),
                           ObjectPlacement=self.place((0.0, 0.0, height), above=self.building))
        self.aggregate(self.building, made)
        self.storeys.append(made)
        return made

    def space(self, name: str | None, corners: Points, height: float = 2.5, *, storey: Any = None,
              long_name: str | None = None, shape: Any = None, contained: bool = False, **values: Any) -> Any:
        """A space over these corners of its storey; ``shape``, or "none", is put in place of the prism."""
        storey = storey if storey is not None else self.storeys[-1]
        body = None if shape == "none" else shape or self.shape(self.extruded(self.profile(corners), 0.0, height))
        made = self.rooted("IfcSpace", name, LongName=long_name, ObjectPlacement=self.place(above=storey),
                           Representation=body, **values)
        (self.contain if contained else self.aggregate)(storey, made)
        return made

    def element(self, kind: str, corners: Points, low: float, height: float, *, storey: Any = None,
                name: str | None = None, at: Sequence[float] = (0.0, 0.0, 0.0), turn_deg: float = 0.0,
                contained: bool = True, **values: Any) -> Any:
        """A prism over its storey, which contains it or not; its corners are in its own frame, which stands at ``at``.
        """
        storey = storey if storey is not None else self.storeys[-1]
        made = self.rooted(kind, name, ObjectPlacement=self.place(at, turn_deg, above=storey),
                           Representation=self.shape(self.extruded(self.profile(corners), low, height)), **values)
        if contained and not kind.startswith("IfcOpening"):
            self.contain(storey, made)
        return made

    def wall(self, x0: float, y0: float, x1: float, y1: float, height: float = 2.7, **values: Any) -> Any:
        return self.element("IfcWall", box(x0, y0, x1, y1), 0.0, height, **values)

    def opening(self, wall: Any, x0: float, y0: float, x1: float, y1: float, low: float = 0.0, height: float = 2.1,
                **values: Any) -> Any:
        made = self.element("IfcOpeningElement", box(x0, y0, x1, y1), low, height, **values)
        self.rooted("IfcRelVoidsElement", None, RelatingBuildingElement=wall, RelatedOpeningElement=made)
        return made

    def door(self, x0: float, y0: float, x1: float, y1: float, *, wall: Any = None, spaces: Sequence[Any] = (),
             kind: str = "IfcDoor", low: float = 0.0, height: float = 2.1, storey: Any = None, leaf: bool = True,
             own_frame: bool = True, told: bool = True) -> Any:
        """A door in the hole x0 .. x1, y0 .. y1 of the plan, whose longer side is its width.

        ``own_frame``: its x axis runs along its wall, as the standard wants it.
        """
        turn = 90.0 if y1 - y0 > x1 - x0 and own_frame else 0.0
        width, depth = max(x1 - x0, y1 - y0), min(x1 - x0, y1 - y0)
        corners = box(0.0, -0.02, width, 0.02) if own_frame else box(x0, y0, x1, y1)
        at = (x0, y0, 0.0) if own_frame else (0.0, 0.0, 0.0)
        if own_frame:
            at = (x0 + depth / 2, y0, 0.0) if turn else (x0, y0 + depth / 2, 0.0)
        sizes = {"OverallWidth": self.n(width), "OverallHeight": self.n(height)} if told else {}
        made = self.element(kind, corners, low, height, at=at, turn_deg=turn, storey=storey, **sizes)
        if not leaf:
            made.Representation = None
        if wall is not None:
            hole = self.opening(wall, x0, y0, x1, y1, low, height, storey=storey)
            self.rooted("IfcRelFillsElement", None, RelatingOpeningElement=hole, RelatedBuildingElement=made)
        for space in spaces:
            self.bound(space, made)
        return made

    def bound(self, space: Any, element: Any = None, how: str = "PHYSICAL") -> None:
        self.rooted("IfcRelSpaceBoundary", None, RelatingSpace=space, RelatedBuildingElement=element,
                    PhysicalOrVirtualBoundary=how, InternalOrExternalBoundary="INTERNAL")

    def write(self, path: Path) -> Path:
        self.file.write(str(path))
        return path


def flat(house: House, **values: Any) -> House:
    """Two rooms of 4 by 3 m and 2 by 3 m either side of a wall of 20 cm with a door, in a storey of 0 m."""
    house.storey("Ground", 0.0)
    a = house.space("1", box(0.0, 0.0, 4.0, 3.0), long_name="Living")
    b = house.space("2", box(4.2, 0.0, 6.2, 3.0), long_name="Bath")
    wall = house.wall(4.0, 0.0, 4.2, 3.0)
    house.door(4.0, 1.0, 4.2, 1.9, wall=wall, **values)
    house.bound(a, wall)
    house.bound(b, wall)
    return house
