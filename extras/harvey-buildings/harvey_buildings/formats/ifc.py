"""Reading IFC (ISO 16739) building files with ifcopenshell (an extra), in a process of its own."""

from __future__ import annotations

import codecs
import multiprocessing
import re
from collections.abc import Callable
from importlib.util import find_spec
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from harvey_buildings.fitting.building_plan import BuildingError, BuildingPlan, Floats
from harvey_buildings.formats.ifc_elements import FURNITURE, Contents, Passages, Spaces
from harvey_buildings.formats.ifc_file import ELEMENT_S, READ_ERRORS, ElementShape, IfcFile, ReadingProgress, first_line

TAIL_BYTES = 65536
"""How much of a file's start and end is searched for its first and last line."""
START_S, OPEN_S, OPEN_S_PER_MB = 60.0, 10.0, 5.0
"""Time limits to start the process and to open a file; beyond these the file is given up."""


def read_ifc(path: Path) -> BuildingPlan:
    """The building plan of an IFC file, read in a process of its own: a broken file may crash or hang native code.

    Raises:
        BuildingError: the file cannot be read, or ifcopenshell is not installed.
    """
    if find_spec("ifcopenshell") is None:
        raise BuildingError(f"{path.name}: reading IFC takes ifcopenshell, which is not installed: "
                            ".venv/bin/pip install ifcopenshell")
    context = multiprocessing.get_context("spawn")
    answers, sender = context.Pipe(duplex=False)
    child = context.Process(target=_serve, args=(path, sender), daemon=True)
    child.start()
    sender.close()
    try:
        answer = await_answer(path, answers)
    except EOFError:
        answer = f"{path.name}: expected an IFC file, got one that ends ifcopenshell"
    finally:
        child.kill()
        child.join()
        answers.close()
    if isinstance(answer, BuildingPlan):
        return answer
    raise BuildingError(answer)


def await_answer(path: Path, answers: Connection) -> BuildingPlan | str:
    """The plan or the error text that the reading process sends, each step within the time limit that it announced."""
    limit_s, doing = START_S, "starting to read"
    while answers.poll(limit_s):
        message: ReadingProgress | BuildingPlan | str = answers.recv()
        if not isinstance(message, ReadingProgress):
            return message
        limit_s, doing = message.limit_s, message.doing
    return (f"{path.name}: expected an IFC file, got one that ifcopenshell does not get done with: {doing} was given up"
            f" after {limit_s:.0f} s")


def _serve(path: Path, sender: Connection) -> None:
    """The reading process: sends its progress, and in the end a plan or an error text."""
    try:
        sender.send(_read(path, sender.send))
    except BuildingError as error:
        sender.send(str(error))


def _read(path: Path, send: Callable[[ReadingProgress], None]) -> BuildingPlan:
    import ifcopenshell
    import ifcopenshell.geom

    try:
        send(ReadingProgress("opening it", OPEN_S + OPEN_S_PER_MB * path.stat().st_size / 1e6))
        data = path.read_bytes()
        text = to_step(data)
        if _is_truncated(text):
            raise ValueError("one that is cut off: END-ISO-10303-21; is missing")
        plain = text.encode() == data
        model = ifcopenshell.open(str(path)) if plain else ifcopenshell.file.from_string(text)
    except (*READ_ERRORS, OSError, ifcopenshell.Error) as error:
        raise BuildingError(f"{path.name}: expected an IFC file, got: {first_line(error)}") from None
    file = IfcFile(path.stem, path.name, model, _build_shape_reader(), _read_placement, send)
    try:
        if not _has_unit(model):
            _assume_metres(model)
            file.plan.report.guessed.append("the file says nothing of its unit of length: taken for metres")
        file.unit_m = _read_unit_m(model)
        return read_plan(file)
    except READ_ERRORS as error:
        if isinstance(error, BuildingError):
            raise
        raise BuildingError(f"{path.name}: expected an IFC file with spaces, got, {file.doing}: {first_line(error)}"
                            ) from None


def _is_truncated(text: str) -> bool:
    return "ISO-10303-21;" in text[:TAIL_BYTES] and "END-ISO-10303-21" not in text[-TAIL_BYTES:]


MARKS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF32_LE, "utf-32"), (codecs.BOM_UTF32_BE, "utf-32"),
         (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))
"""Byte order marks, which editors put before a text, and what they say of it; UTF-16's is the start of UTF-32's."""
ESCAPES = re.compile(r"(\\\\|\\S\\[^']|\\P[A-I]\\|\\X\\[0-9A-F]{2}|\\X2\\(?:[0-9A-F]{4})+\\X0\\"
                     r"|\\X4\\(?:[0-9A-F]{8})+\\X0\\)|\\")
"""What may follow a backslash in a text (ISO 10303-21, 6.4.3), or one that stands alone, as in C:\\temp."""


def to_step(data: bytes) -> str:
    """A file as STEP wants it, which some programs do not write: no mark at its start, every letter beyond ASCII
    escaped, and every backslash that begins no escape. Raises ValueError where its mark is not true."""
    marked = next((encoding for mark, encoding in MARKS if data.startswith(mark)), None)
    try:
        text = data.decode(marked or "utf-8")
    except UnicodeDecodeError:
        if marked:
            raise ValueError(f"one whose first bytes say {marked}, which it is not") from None
        text = data.decode("cp1252", errors="replace")
    text = ESCAPES.sub(lambda found: found[1] or r"\\", text)
    return re.sub(r"[^\x00-\x7f]+", lambda found: f"\\X4\\{found[0].encode('utf-32-be').hex().upper()}\\X0\\", text)


def _build_shape_reader() -> Callable[[Any, bool], ElementShape]:
    """A function for the shape of an element; with ``roughly`` also from its bounding box or its lines on the plan."""
    import ifcopenshell.geom

    library: Any = ifcopenshell  # its log has no types
    geometry = library.geom
    settings, rough = geometry.settings(), geometry.settings()
    rough.set("keep-bounding-boxes", True)
    rough.set("dimensionality", library.ifcopenshell_wrapper.CURVES_SURFACES_AND_SOLIDS)

    def shape(element: Any, roughly: bool) -> ElementShape:
        library.get_log()  # empties it
        try:
            made = geometry.create_shape(rough if roughly else settings, element)
        except RuntimeError as error:
            if not getattr(element, "Representation", None):
                raise ValueError("the file gives it no shape") from None
            reason = _find_reason(library.get_log()) or first_line(error)
            raise ValueError(f"the file gives it a shape that cannot be read: {reason}") from None
        points = np.array(made.geometry.verts, float).reshape(-1, 3)
        frame = np.array(made.transformation.matrix, float).reshape(4, 4).T[:3]
        if not len(points) or not np.isfinite(points).all() or not np.isfinite(frame).all():
            raise ValueError("it has no shape")
        return ElementShape(points, np.array(made.geometry.faces, int).reshape(-1, 3), frame,
                            np.array(made.geometry.edges, int).reshape(-1, 2))

    return shape


def _find_reason(log: str) -> str | None:
    """The first error of ifcopenshell's log, with the kind of entity that it is about; None where there is none."""
    found = re.search(r"^\[error\] (?:\[[^]\n]*\] )*(.+?)(?::\n#\d+=(\w+).*)?$", log, re.MULTILINE)
    return found and first_line(ValueError(" ".join(part for part in found.groups() if part)))


def _read_placement(element: Any) -> Floats | None:
    """(4, 4) file_from_element of an element's placement, in the file's unit; None where it has none."""
    import ifcopenshell.util.placement

    if getattr(element, "ObjectPlacement", None) is None:
        return None
    return np.array(ifcopenshell.util.placement.get_local_placement(element.ObjectPlacement), float)


def _has_unit(model: Any) -> bool:
    return any(getattr(unit, "UnitType", None) == "LENGTHUNIT" for project in model.by_type("IfcProject")
               for unit in getattr(project.UnitsInContext, "Units", None) or ())


def _assume_metres(model: Any) -> None:
    for project in model.by_type("IfcProject"):
        units = tuple(getattr(project.UnitsInContext, "Units", None) or ())
        metre = model.create_entity("IfcSIUnit", UnitType="LENGTHUNIT", Name="METRE")
        project.UnitsInContext = model.create_entity("IfcUnitAssignment", Units=[*units, metre])


def _read_unit_m(model: Any) -> float:
    """The file's unit of length [m]."""
    import ifcopenshell.util.unit

    try:
        return float(ifcopenshell.util.unit.calculate_unit_scale(model))
    except READ_ERRORS:
        return 1.0


def read_plan(file: IfcFile) -> BuildingPlan:
    """Everything that is used of the file. Raises BuildingError where it has no usable space."""
    file.send(ReadingProgress("reading its storeys", ELEMENT_S))
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
