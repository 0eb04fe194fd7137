"""IFC (ISO 16739) building files: spaces, doors, windows, stairs and furniture, read with ifcopenshell (an extra)."""

from __future__ import annotations

import multiprocessing
import re
from collections.abc import Callable
from importlib.util import find_spec
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from world_models.files.importers.ifc.opened_file import READ_ERRORS, IfcFile, Next, first_line
from world_models.files.importers.ifc.reader import plan_of
from world_models.files.importers.ifc.shapes import Body
from world_models.files.importers.plan import BuildingError, Plan

TAIL = 65536
START_S, OPEN_S, OPEN_S_PER_MB = 60.0, 10.0, 5.0
"""A file that takes longer to open is given up."""


def read_ifc(path: Path) -> Plan:
    """What is in an IFC file. Raises BuildingError where it cannot be read, or ifcopenshell is not installed.

    The file is read in a process of its own: a spoilt one may end or hang the library's native code.
    """
    if find_spec("ifcopenshell") is None:
        raise BuildingError(f"{path.name}: reading IFC takes ifcopenshell, which is not installed: "
                            ".venv/bin/pip install '.[ifc]'")
    context = multiprocessing.get_context("spawn")
    answers, sender = context.Pipe(duplex=False)
    child = context.Process(target=_answer, args=(path, sender), daemon=True)
    child.start()
    sender.close()
    try:
        answer = heard(path, answers)
    except EOFError:
        answer = f"{path.name}: expected an IFC file, got one that ends ifcopenshell"
    finally:
        child.kill()
        child.join()
        answers.close()
    if isinstance(answer, Plan):
        return answer
    raise BuildingError(answer)


def heard(path: Path, answers: Connection) -> Plan | str:
    """What the reading process says in the end; on the way it tells what it is about to do."""
    limit_s, doing = START_S, "starting to read"
    while answers.poll(limit_s):
        said: Next | Plan | str = answers.recv()
        if not isinstance(said, Next):
            return said
        limit_s, doing = said.limit_s, said.doing
    return (f"{path.name}: expected an IFC file, got one that ifcopenshell does not get done with: {doing} was given up"
            f" after {limit_s:.0f} s")


def _answer(path: Path, sender: Connection) -> None:
    """What the reading process does: sends what it is about, and in the end a plan, or what is wrong with the file."""
    try:
        sender.send(_read(path, sender.send))
    except BuildingError as error:
        sender.send(str(error))


def _read(path: Path, tell: Callable[[Next], None]) -> Plan:
    import ifcopenshell
    import ifcopenshell.geom

    try:
        tell(Next("opening it", OPEN_S + OPEN_S_PER_MB * path.stat().st_size / 1e6))
        if _cut_off(path):
            raise ValueError("one that is cut off: END-ISO-10303-21; is missing")
        plain = path.read_bytes().isascii()
        model = ifcopenshell.open(str(path)) if plain else ifcopenshell.file.from_string(_plain(path))
    except (*READ_ERRORS, OSError, ifcopenshell.Error) as error:
        raise BuildingError(f"{path.name}: expected an IFC file, got: {first_line(error)}") from None
    file = IfcFile(path.stem, path.name, model, _shapes(), _height, tell)
    try:
        if not _has_unit(model):
            _take_metres(model)
            file.plan.account.guessed.append("the file says nothing of its unit of length: taken for metres")
        file.unit_m = _unit_m(model)
        return plan_of(file)
    except READ_ERRORS as error:
        if isinstance(error, BuildingError):
            raise
        raise BuildingError(f"{path.name}: expected an IFC file with spaces, got: {first_line(error)}") from None


def _cut_off(path: Path) -> bool:
    data = path.read_bytes()
    return b"ISO-10303-21;" in data[:TAIL] and b"END-ISO-10303-21" not in data[-TAIL:]


def _plain(path: Path) -> str:
    """The text of a file that has letters with accents as they are, as some programs write them: spelled out."""
    data = path.read_bytes()
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:
        text = data.decode("cp1252", errors="replace")
    return re.sub(r"[^\x00-\x7f]+", lambda found: f"\\X4\\{found[0].encode('utf-32-be').hex().upper()}\\X0\\", text)


def _shapes() -> Callable[[Any, bool], Body]:
    """How an element's shape is had from ifcopenshell; roughly: also from its bounding box, or lines on the plan."""
    import ifcopenshell.geom

    geometry: Any = ifcopenshell.geom
    settings, rough = geometry.settings(), geometry.settings()
    rough.set("keep-bounding-boxes", True)
    rough.set("dimensionality", ifcopenshell.ifcopenshell_wrapper.CURVES_SURFACES_AND_SOLIDS)

    def shape(element: Any, roughly: bool) -> Body:
        try:
            made = geometry.create_shape(rough if roughly else settings, element)
        except RuntimeError:
            told = "a shape that cannot be read" if getattr(element, "Representation", None) else "no shape"
            raise ValueError(f"the file gives it {told}") from None
        points = np.array(made.geometry.verts, float).reshape(-1, 3)
        frame = np.array(made.transformation.matrix, float).reshape(4, 4).T[:3]
        if not len(points) or not np.isfinite(points).all() or not np.isfinite(frame).all():
            raise ValueError("it has no shape")
        return Body(points, np.array(made.geometry.faces, int).reshape(-1, 3), frame,
                    np.array(made.geometry.edges, int).reshape(-1, 2))

    return shape


def _height(element: Any) -> float | None:
    """Where an element is placed above the file's zero, in the file's unit; None where that is not said."""
    import ifcopenshell.util.placement

    if getattr(element, "ObjectPlacement", None) is None:
        return None
    return float(ifcopenshell.util.placement.get_local_placement(element.ObjectPlacement)[2][3])


def _has_unit(model: Any) -> bool:
    return any(getattr(unit, "UnitType", None) == "LENGTHUNIT" for project in model.by_type("IfcProject")
               for unit in getattr(project.UnitsInContext, "Units", None) or ())


def _take_metres(model: Any) -> None:
    for project in model.by_type("IfcProject"):
        units = tuple(getattr(project.UnitsInContext, "Units", None) or ())
        metre = model.create_entity("IfcSIUnit", UnitType="LENGTHUNIT", Name="METRE")
        project.UnitsInContext = model.create_entity("IfcUnitAssignment", Units=[*units, metre])


def _unit_m(model: Any) -> float:
    """The file's unit of length [m]."""
    import ifcopenshell.util.unit

    try:
        return float(ifcopenshell.util.unit.calculate_unit_scale(model))
    except READ_ERRORS:
        return 1.0
