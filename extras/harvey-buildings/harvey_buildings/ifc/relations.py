"""Names, containers, hosts and fillings of the elements of an IFC file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any


def name_of(element: Any) -> str:
    """Its name, or an empty text."""
    return str(getattr(element, "Name", None) or "").strip()


def containers(element: Any) -> Iterator[Any]:
    """The elements that this one is part of or contained in, from the nearest up."""
    seen: set[int] = set()
    while element is not None and element.id() not in seen:
        seen.add(element.id())
        above = [getattr(relation, "RelatingObject", None) or getattr(relation, "RelatingStructure", None)
                 for way in ("Decomposes", "ContainedInStructure") for relation in getattr(element, way, None) or ()]
        element = next((one for one in above if one is not None), None)
        if element is not None:
            yield element


def host(opening: Any) -> Any:
    """The wall that an opening is in; None where there is none."""
    voids = getattr(opening, "VoidsElements", None) or ()
    return voids[0].RelatingBuildingElement if voids else None


def filling(opening: Any) -> list[Any]:
    """The doors and windows in an opening; some programs bound a space by the opening alone."""
    return [relation.RelatedBuildingElement for relation in getattr(opening, "HasFillings", ())]
