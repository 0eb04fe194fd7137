"""The law of spoilt building files: a clear error or a world that can be read and checked, never a traceback."""

import re
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from world_models.importers import BuildingError, import_building
from world_models.store import read_world
from world_models.toml_source import Source

SQUARE = ((0, 0), (4, 0), (4, 3), (0, 3))
SPOILT = ("0", "-1.0", "nan", "inf", "1e300", "1e-300", "#1", "#nothing", "", "'", '"', "$", "*", "()", "<", ">",
          "&b;", "3.5")


def _cell(name: str, x: float, z: float, corners: tuple[tuple[int, int], ...] = SQUARE) -> str:
    ring = "".join(f"<g:pos>{x + a} {b} {z}</g:pos>" for a, b in (*corners, corners[0]))
    return (f'<c:CellSpace g:id="{name}"><g:name>{name}</g:name><c:g><g:LinearRing>{ring}</g:LinearRing></c:g>'
            f'<c:duality x:href="#S{name}"/></c:CellSpace>')


def _state(name: str, x: float, z: float) -> str:
    return (f'<c:State g:id="S{name}"><c:duality x:href="#{name}"/><g:Point><g:pos>{x} 1.5 {z}</g:pos></g:Point>'
            "</c:State>")


def _way(a: str, b: str) -> str:
    return f'<c:Transition><c:connects x:href="#S{a}"/><c:connects x:href="#S{b}"/></c:Transition>'


GML = (
    '<c:IndoorFeatures xmlns:c="c" xmlns:g="http://www.opengis.net/gml/3.2" xmlns:x="http://www.w3.org/1999/xlink">'
    + _cell("Hall", 0, 0) + _cell("Room", 4.2, 0) + _cell("Door1", 4, 0, ((0, 1), (1, 1), (1, 2), (0, 2)))
    + _cell("Lift1", 8.2, 0) + _cell("Lift2", 8.2, 1) + "<c:SpaceLayer>"
    + _state("Hall", 2, 0) + _state("Door1", 4.1, 0) + _state("Room", 6, 0) + _state("Lift1", 10, 0)
    + _state("Lift2", 10, 1) + _way("Hall", "Door1") + _way("Door1", "Room") + _way("Room", "Lift1")
    + _way("Lift1", "Lift2") + "</c:SpaceLayer></c:IndoorFeatures>"
)


def _ifc_space(number: int, name: str, x: float) -> str:
    n = 100 * number
    return (
        f"#{n}=IFCCARTESIANPOINT(({x},0.,0.));\n#{n + 1}=IFCAXIS2PLACEMENT3D(#{n},$,$);\n"
        f"#{n + 2}=IFCLOCALPLACEMENT($,#{n + 1});\n#{n + 3}=IFCCARTESIANPOINT((2.,1.5));\n"
        f"#{n + 4}=IFCAXIS2PLACEMENT2D(#{n + 3},$);\n#{n + 5}=IFCRECTANGLEPROFILEDEF(.AREA.,$,#{n + 4},4.,3.);\n"
        f"#{n + 6}=IFCEXTRUDEDAREASOLID(#{n + 5},#8,#7,2.5);\n"
        f"#{n + 7}=IFCSHAPEREPRESENTATION(#9,'Body','SweptSolid',(#{n + 6}));\n"
        f"#{n + 8}=IFCPRODUCTDEFINITIONSHAPE($,$,(#{n + 7}));\n"
        f"#{n + 9}=IFCSPACE('{number:022d}',#6,'{name}',$,$,#{n + 2},#{n + 8},'Room',.ELEMENT.,.INTERNAL.,$);\n"
        f"#{n + 10}=IFCRELAGGREGATES('{number + 50:022d}',#6,$,$,#12,(#{n + 9}));\n"
    )


IFC = (
    "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\n"
    "FILE_SCHEMA(('IFC2X3'));\nENDSEC;\nDATA;\n"
    "#1=IFCPERSON($,$,'a',$,$,$,$,$);\n#2=IFCORGANIZATION($,'a',$,$,$);\n#3=IFCPERSONANDORGANIZATION(#1,#2,$);\n"
    "#4=IFCAPPLICATION(#2,'1','a','a');\n#5=IFCCARTESIANPOINT((0.,0.,0.));\n"
    "#6=IFCOWNERHISTORY(#3,#4,$,.ADDED.,$,$,$,0);\n#7=IFCDIRECTION((0.,0.,1.));\n#8=IFCAXIS2PLACEMENT3D(#5,$,$);\n"
    "#9=IFCGEOMETRICREPRESENTATIONCONTEXT($,'Model',3,1.E-5,#8,$);\n#10=IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.);\n"
    "#11=IFCUNITASSIGNMENT((#10));\n"
    "#12=IFCBUILDINGSTOREY('0000000000000000000001',#6,'Ground',$,$,$,$,$,.ELEMENT.,0.);\n"
    "#13=IFCPROJECT('0000000000000000000002',#6,'p',$,$,$,$,(#9),#11);\n"
    + _ifc_space(1, "A", 0.0) + _ifc_space(2, "B", 4.0) + "ENDSEC;\nEND-ISO-10303-21;\n"
)


def _judged(path: Path, text: str) -> str:
    path.write_text(text, encoding="utf-8")
    try:
        made = import_building(path)
    except BuildingError as error:
        assert path.name in str(error)
        return "error"
    return "faults" if read_world(Source.parse(made.text)).check() else "sound"


def _spoil(text: str, changes: list[tuple[int, int]]) -> str:
    words = list(re.finditer(r"[-\w.#]+|\"[^\"]*\"|'[^']*'", text))
    chosen = {place % len(words): SPOILT[what % len(SPOILT)] for place, what in changes}
    for place in sorted(chosen, reverse=True):
        text = text[: words[place].start()] + chosen[place] + text[words[place].end() :]
    return text


CHANGES = st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 100)), min_size=1, max_size=6)
LAW = settings(max_examples=60, deadline=None, derandomize=True,
               suppress_health_check=[HealthCheck.function_scoped_fixture])


def test_the_gml_text_is_sound_before_it_is_spoilt(tmp_path: Path) -> None:
    assert _judged(tmp_path / "a.gml", GML) == "sound"
    assert "open = true" in import_building(tmp_path / "a.gml").text
    assert 'kind = "elevator"' in import_building(tmp_path / "a.gml").text


@LAW
@given(changes=CHANGES)
def test_spoilt_gml_is_an_error_or_a_world(tmp_path: Path, changes: list[tuple[int, int]]) -> None:
    assert _judged(tmp_path / "a.gml", _spoil(GML, changes)) in ("error", "sound", "faults")


@pytest.mark.skipif(find_spec("ifcopenshell") is None, reason="needs ifcopenshell (the extra ifc)")
def test_the_ifc_text_is_sound_before_it_is_spoilt(tmp_path: Path) -> None:
    assert _judged(tmp_path / "a.ifc", IFC) == "sound"
    assert "open = true" in import_building(tmp_path / "a.ifc").text


@pytest.mark.skipif(find_spec("ifcopenshell") is None, reason="needs ifcopenshell (the extra ifc)")
@settings(LAW, max_examples=8)
@given(changes=CHANGES)
def test_spoilt_ifc_is_an_error_or_a_world(tmp_path: Path, changes: list[tuple[int, int]]) -> None:
    assert _judged(tmp_path / "a.ifc", _spoil(IFC, changes)) in ("error", "sound", "faults")


def test_deep_xml_is_refused(tmp_path: Path) -> None:
    deep = sys.getrecursionlimit() * 10
    assert _judged(tmp_path / "a.gml", "<a>" * deep + "</a>" * deep) == "error"


@pytest.mark.skipif(find_spec("ifcopenshell") is None, reason="needs ifcopenshell (the extra ifc)")
def test_a_file_that_ends_the_library_is_an_error(tmp_path: Path) -> None:
    assert _judged(tmp_path / "a.ifc", IFC.replace("('IFC2X3')", "(3.5)")) == "error"
