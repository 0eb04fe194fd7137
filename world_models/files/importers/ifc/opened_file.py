"""An opened IFC file, and the plan that is made of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import shapely

from world_models.files.importers.ifc.relations import name_of
from world_models.files.importers.ifc.shapes import Body, Ground
from world_models.files.importers.outlines import Floats
from world_models.files.importers.plan import Names, Plan, slug

READ_ERRORS = (RuntimeError, ValueError, TypeError, AttributeError, IndexError, KeyError, OverflowError)
"""What ifcopenshell and the geometry of a spoilt file raise."""
ELEMENT_S = 20.0
"""An element that takes longer to be read is given up, and the file with it."""
MANY = 3
"""Elements that are left out for one reason are told together if they are more."""


class Next(NamedTuple):
    """What the reading process does next, and how long that may take."""

    doing: str
    limit_s: float


def first_line(error: Exception) -> str:
    """What an error says, in short."""
    return (str(error).strip() or type(error).__name__).splitlines()[0][:200]


@dataclass
class IfcFile:
    """What is read from, and what is known by then.

    Attributes:
        stem, source: name of the file, without and with its ending.
        model: the file as ifcopenshell has it.
        shape: the shape of an element; told to be rough, also from its bounding box or its lines on the plan.
        height: how high an element is placed, in the file's unit.
        tell: hears what is done next.
        unit_m: the file's unit of length [m].
        ground: where the plan's zero is in the file, and how it is turned; known once the spaces are.
        by_id: the plan's name of each space of the file. floors: by that name, where one can stand in it.
    """

    stem: str
    source: str
    model: Any
    shape: Callable[[Any, bool], Body]
    height: Callable[[Any], float | None]
    tell: Callable[[Next], None]
    unit_m: float = 1.0
    plan: Plan = field(init=False)
    names: Names = field(init=False)
    ground: Ground = field(init=False)
    by_id: dict[int, str] = field(default_factory=dict)
    floors: dict[str, shapely.Polygon] = field(default_factory=dict)

    def __post_init__(self) -> None:
        title = slug(self.stem) or "building"
        self.plan, self.names = Plan(title, self.source), Names(title)

    def all(self, *kinds: str) -> list[Any]:
        """The elements of some kinds; none where the schema does not know one."""
        found: list[Any] = []
        for kind in kinds:
            try:
                found += self.model.by_type(kind)
            except RuntimeError:
                continue
        return found

    def each(self, kind: str, read: Callable[[Any], None]) -> None:
        """Read every element of a kind; those that cannot be read are left out and named."""
        failed: dict[str, list[str]] = {}
        for element in self.all(kind):
            self.next(element)
            try:
                read(element)
            except READ_ERRORS as error:
                failed.setdefault(first_line(error), []).append(f"#{element.id()} {name_of(element)}".rstrip())
        for why, which in failed.items():
            if len(which) > MANY:
                self.plan.account.left_out.append(f"{len(which)} of {kind}: {why} ({', '.join(which[:MANY])}, ...)")
            else:
                self.plan.account.left_out += [f"{kind} {label}: {why}" for label in which]

    def next(self, element: Any) -> None:
        """Tell that an element is read now."""
        self.tell(Next(f"reading {element.is_a()} #{element.id()}", ELEMENT_S))

    def body(self, element: Any) -> Body:
        """Its shape on the plan's ground. Raises ValueError, or what ifcopenshell raises, where it has none."""
        return self.ground.under(self.shape(element, False))

    def body_of(self, element: Any) -> Body | None:
        """Its shape where it has one."""
        try:
            return self.body(element)
        except READ_ERRORS:
            return None

    def away(self, space: str, point: Floats) -> float:
        """How far a point is from where one can stand in a space, on the plan [m]."""
        return float(self.floors[space].distance(shapely.Point(point)))
