"""An opened IFC file, and the building plan that is read from it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import shapely

from harvey_buildings.building_plan import BuildingPlan, Names, slug
from harvey_buildings.ifc.relations import name_of
from harvey_buildings.ifc.shapes import Body, PlanOrigin
from harvey_buildings.polygons import Floats

READ_ERRORS = (RuntimeError, ValueError, TypeError, AttributeError, IndexError, KeyError, OverflowError)
"""What ifcopenshell and the geometry of a broken file raise."""
ELEMENT_S = 20.0
"""Time limit to read one element; beyond it the file is given up."""
MAX_LISTED = 3
"""More elements that are left out for the same reason are reported together."""


class Progress(NamedTuple):
    """What the reading process does next, and its time limit."""

    doing: str
    limit_s: float


def first_line(error: Exception) -> str:
    """The first line of an error's text, shortened."""
    return (str(error).strip() or type(error).__name__).splitlines()[0][:200]


@dataclass
class IfcFile:
    """The file, and what is known of it while it is read.

    Attributes:
        stem, source: name of the file without and with its suffix.
        model: the file as ifcopenshell has it.
        shape: reads the shape of an element; with True also roughly, from its bounding box or its lines on the plan.
        height: reads the height of an element's placement, in the file's unit.
        send: takes progress messages.
        unit_m: the file's unit of length [m].
        origin: origin and direction of the plan in the file; known once the spaces are.
        by_id: the plan's name of each space, by the file's id.
        floors: the floor polygon of each space, by name.
    """

    stem: str
    source: str
    model: Any
    shape: Callable[[Any, bool], Body]
    height: Callable[[Any], float | None]
    send: Callable[[Progress], None]
    unit_m: float = 1.0
    plan: BuildingPlan = field(init=False)
    names: Names = field(init=False)
    origin: PlanOrigin = field(init=False)
    by_id: dict[int, str] = field(default_factory=dict)
    floors: dict[str, shapely.Polygon] = field(default_factory=dict)

    def __post_init__(self) -> None:
        title = slug(self.stem) or "building"
        self.plan, self.names = BuildingPlan(title, self.source), Names(title)

    def all(self, *kinds: str) -> list[Any]:
        """All elements of these kinds; kinds that the schema does not know have none."""
        found: list[Any] = []
        for kind in kinds:
            try:
                found += self.model.by_type(kind)
            except RuntimeError:
                continue
        return found

    def each(self, kind: str, read: Callable[[Any], None]) -> None:
        """Read every element of a kind; those that cannot be read are left out and reported."""
        failed: dict[str, list[str]] = {}
        for element in self.all(kind):
            self.report_progress(element)
            try:
                read(element)
            except READ_ERRORS as error:
                failed.setdefault(first_line(error), []).append(f"#{element.id()} {name_of(element)}".rstrip())
        for why, which in failed.items():
            if len(which) > MAX_LISTED:
                listed = ", ".join(which[:MAX_LISTED])
                self.plan.report.left_out.append(f"{len(which)} of {kind}: {why} ({listed}, ...)")
            else:
                self.plan.report.left_out += [f"{kind} {label}: {why}" for label in which]

    def report_progress(self, element: Any) -> None:
        """Report that an element is read now, which starts its time limit."""
        self.send(Progress(f"reading {element.is_a()} #{element.id()}", ELEMENT_S))

    def body(self, element: Any) -> Body:
        """Shape of an element on the plan. Raises ValueError, or what ifcopenshell raises, where it has none."""
        return self.origin.place_on_plan(self.shape(element, False))

    def body_of(self, element: Any) -> Body | None:
        """Shape of an element on the plan; None where it has none."""
        try:
            return self.body(element)
        except READ_ERRORS:
            return None

    def distance_m(self, space: str, point: Floats) -> float:
        """Distance on the plan of a point (2,) from the floor of a space [m]."""
        return float(self.floors[space].distance(shapely.Point(point)))
