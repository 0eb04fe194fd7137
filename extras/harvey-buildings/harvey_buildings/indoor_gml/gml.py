"""GML elements: their ids, texts, references and points, whatever the namespace and version."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np

from harvey_buildings.polygons import Floats

HREF = "{http://www.w3.org/1999/xlink}href"
MAX_COORDINATE = 1e8
"""Projected coordinates have seven digits before the point."""


def elements(root: ET.Element, *names: str) -> list[ET.Element]:
    """All elements with one of these names below one, in the order of the file."""
    wanted = set(names)
    return [e for e in root.iter() if isinstance(e.tag, str) and local_name(e) in wanted]


def local_name(element: ET.Element) -> str:
    """The name of an element without its namespace."""
    return element.tag.rpartition("}")[2]


def identifier(element: ET.Element) -> str:
    """The id of an element; "" for none."""
    return next((text for key, text in element.attrib.items() if key.rpartition("}")[2] == "id"), "")


def references(element: ET.Element, name: str) -> list[str]:
    """Ids that the elements with this name refer to; a reversed boundary counts as that boundary."""
    found = [link_of(e) for e in elements(element, name)]
    return [text for text in found if text]


def link_of(element: ET.Element) -> str:
    """The id that an element refers to; "" for none."""
    return element.get(HREF, "").removeprefix("#").removesuffix("-REVERSE")


def texts(element: ET.Element, *names: str) -> list[str]:
    """Texts of an element's children with these names."""
    found = [(child.text or "").strip() for name in names for child in element
             if isinstance(child.tag, str) and local_name(child) == name]
    return [text for text in found if text]


def positions(element: ET.Element, origin: Floats) -> Floats:
    """(n, 3) the points of an element less ``origin`` (3,); z is 0 where it lacks; empty where they are no numbers."""
    rows: list[list[float]] = []
    try:
        for child in elements(element, "pos", "posList"):
            flat = [float(word) for word in (child.text or "").split()]
            size = _dimension(child, len(flat))
            rows += [[*flat[i : i + size], 0.0, 0.0, 0.0][:3] for i in range(0, len(flat) - size + 1, size)]
    except ValueError:
        return np.zeros((0, 3))
    points = np.array(rows, float).reshape(-1, 3)
    good = np.isfinite(points).all() and np.abs(points).max(initial=0.0) < MAX_COORDINATE
    return points - origin if good else np.zeros((0, 3))


def _dimension(element: ET.Element, count: int) -> int:
    if local_name(element) == "pos":
        return max(count, 1)
    return 2 if element.get("srsDimension") == "2" else 3
