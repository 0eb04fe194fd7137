"""XML that may come from anywhere, read without entities, external files or depth."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from xml.parsers import expat

from harvey_buildings.building_plan import BuildingError

MAX_BYTES = 200_000_000
MAX_DEPTH = 200


def read_xml(path: Path) -> ET.Element:
    """The root element. Raises BuildingError for no XML, a document type declaration, or too large or deep a file."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise BuildingError(f"{path}: expected a readable file, got: {error.strerror}") from None
    if len(data) > MAX_BYTES:
        raise BuildingError(f"{path.name}: expected at most {MAX_BYTES / 1e6:.0f} MB, got {len(data) / 1e6:.0f} MB")
    return _Builder(path.name).build(data)


class _Builder:
    """Builds elements from expat's events; names are ``{namespace}name``."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._builder = ET.TreeBuilder()
        self._depth = 0

    def build(self, data: bytes) -> ET.Element:
        parser = expat.ParserCreate(namespace_separator="}")
        parser.buffer_text = True
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._builder.data
        parser.StartDoctypeDeclHandler = self._refuse
        try:
            parser.Parse(data, True)
            return self._builder.close()
        except (expat.ExpatError, UnicodeDecodeError, LookupError, AssertionError) as error:
            raise BuildingError(f"{self._name}: expected XML, got: {error}") from None

    def _refuse(self, *_: object) -> None:
        raise BuildingError(f"{self._name}: expected XML without a document type declaration, got one; entities are "
                            "not expanded")

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise BuildingError(f"{self._name}: expected at most {MAX_DEPTH} elements within one another, got more")
        self._builder.start(_qualified(tag), {_qualified(key): value for key, value in attributes.items()})

    def _end(self, tag: str) -> None:
        self._depth -= 1
        self._builder.end(_qualified(tag))


def _qualified(name: str) -> str:
    return "{" + name if "}" in name else name
