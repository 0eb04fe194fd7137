"""The law of spoilt building files: a clear error or a world that can be read and checked, never a traceback."""

import multiprocessing
import re
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from experiments.robustness.malformed_worlds import GML, IFC
from harvey_buildings import BuildingError, import_building
from harvey_buildings.formats.ifc import ReadingProgress, await_answer
from world_models.building.checks import check_world
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world

SPOILT = ("0", "-1.0", "nan", "inf", "1e300", "1e-300", "#1", "#nothing", "", "'", '"', "$", "*", "()", "<", ">",
          "&b;", "3.5")


def _judge(path: Path, text: str) -> str:
    path.write_text(text, encoding="utf-8")
    try:
        made = import_building(path)
    except BuildingError as error:
        assert path.name in str(error)
        return "error"
    return "faults" if check_world(read_world(Source.parse(made.text))) else "sound"


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
    assert _judge(tmp_path / "a.gml", GML) == "sound"
    assert "open = true" in import_building(tmp_path / "a.gml").text
    assert 'kind = "elevator"' in import_building(tmp_path / "a.gml").text
    assert "sigma_cm = 5 " in import_building(tmp_path / "a.gml").text  # a plan that was traced


@LAW
@given(changes=CHANGES)
def test_spoilt_gml_is_an_error_or_a_world(tmp_path: Path, changes: list[tuple[int, int]]) -> None:
    assert _judge(tmp_path / "a.gml", _spoil(GML, changes)) in ("error", "sound", "faults")


@pytest.mark.skipif(find_spec("ifcopenshell") is None, reason="needs ifcopenshell")
def test_the_ifc_text_is_sound_before_it_is_spoilt(tmp_path: Path) -> None:
    assert _judge(tmp_path / "a.ifc", IFC) == "sound"
    assert "open = true" in import_building(tmp_path / "a.ifc").text
    assert "sigma_cm = 3 " in import_building(tmp_path / "a.ifc").text  # as it was to be built


@pytest.mark.skipif(find_spec("ifcopenshell") is None, reason="needs ifcopenshell")
@settings(LAW, max_examples=8)
@given(changes=CHANGES)
def test_spoilt_ifc_is_an_error_or_a_world(tmp_path: Path, changes: list[tuple[int, int]]) -> None:
    assert _judge(tmp_path / "a.ifc", _spoil(IFC, changes)) in ("error", "sound", "faults")


def test_deep_xml_is_refused(tmp_path: Path) -> None:
    deep = sys.getrecursionlimit() * 10
    assert _judge(tmp_path / "a.gml", "<a>" * deep + "</a>" * deep) == "error"


@pytest.mark.skipif(find_spec("ifcopenshell") is None, reason="needs ifcopenshell")
def test_a_file_that_ends_the_library_is_an_error(tmp_path: Path) -> None:
    assert _judge(tmp_path / "a.ifc", IFC.replace("('IFC2X3')", "(3.5)")) == "error"


def test_a_file_that_the_library_does_not_get_done_with_is_given_up() -> None:
    answers, sender = multiprocessing.Pipe(duplex=False)
    sender.send(ReadingProgress("reading IfcSpace #109", 0.01))
    told = await_answer(Path("a.ifc"), answers)
    assert isinstance(told, str) and "a.ifc" in told and "IfcSpace #109 was given up" in told
