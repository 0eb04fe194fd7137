"""Settings: each has unit, meaning and source; setting one changes it and nothing else; mistakes are named."""

from __future__ import annotations

import json
import re
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import pytest

from harvey.agent_settings import build_settings, list_robot_rows, names
from harvey.cli import main
from harvey.commands.listing import format_value
from harvey.errors import BadInput
from knowledge_sources.action.fault_handler import MAX_BROKEN_MOTIONS
from knowledge_sources.milestone.obstruction_finder import MAX_OBSTRUCTION_LOOKS
from knowledge_sources.settings import DEFAULT, Row, Settings, list_rows, replace_value
from sim.scenario import load_scenario, with_settings
from world_models.entries.body import LAST_REQUESTS
from world_models.entries.percepts import LAST_SEGMENTS

ROWS, ROBOT_ROWS = list_rows(), list_robot_rows()
UNITS = {"px", "m", "rad", "s", "m/s", "rad/s", "1", "count", "1/m", "grey levels", "grey levels/px", "name", "yes/no"}
FOLDER = Path(__file__).parents[3] / "knowledge_sources"
WORDS = {word for path in FOLDER.rglob("*.py") if path.name != "settings.py"
         for word in re.findall(r"\w+", path.read_text(encoding="utf-8"))}
each_row = pytest.mark.parametrize("row", ROWS, ids=[row.name for row in ROWS])


def numbers(settings: Settings) -> dict[str, Any]:
    """Every field of every room, read from the dataclasses themselves."""
    rooms = {f.name: getattr(settings, f.name) for f in fields(settings)}
    return {f"{name}.{f.name}": getattr(room, f.name) for name, room in rooms.items() for f in fields(room)}


def another(row: Row) -> Any:
    """Another value of the same kind."""
    value: Any = row.value
    return not value if isinstance(value, bool) else value + 1


def test_the_table_has_every_field_of_every_room() -> None:
    assert len(ROWS) > 15
    assert {row.name: row.value for row in ROWS} == numbers(DEFAULT)
    assert all(is_dataclass(getattr(DEFAULT, f.name)) for f in fields(DEFAULT))


@each_row
def test_each_has_a_unit_a_meaning_and_a_source(row: Row) -> None:
    assert row.unit in UNITS
    assert len(row.what.split()) >= 3 and row.what.endswith(".") and row.what[0].isupper()
    assert row.source
    kind = next(f.type for f in fields(getattr(DEFAULT, row.room)) if f.name == row.field)
    assert kind == type(row.value).__name__


@each_row
def test_each_is_read(row: Row) -> None:
    assert row.field in WORDS


@each_row
def test_setting_one_changes_it_and_nothing_else(row: Row) -> None:
    value = another(row)
    changed = replace_value(DEFAULT, row.name, value)
    assert numbers(changed) == {**numbers(DEFAULT), row.name: value}
    assert type(numbers(changed)[row.name]) is type(row.value)
    assert build_settings([(row.name, str(value).lower())]) == changed


@pytest.mark.parametrize("word", ["on", "yes", "true", "True", "off", "no", "false"])
def test_a_switch_takes_any_word_for_on_and_off(word: str) -> None:
    """A setting, and a key of the scenario."""
    is_on = word.lower() in ("on", "yes", "true")
    assert build_settings([("floor.use_ranges", word)]).floor.use_ranges is is_on
    if word != "True":  # of a key only what TOML says
        mission = with_settings(load_scenario("forty-foot-hallway"), {"motion.continuous": word, "servo.plan": word})
        assert mission.motion.continuous is is_on and mission.servo.plan is is_on


def test_no_more_is_asked_of_the_board_than_it_keeps() -> None:
    assert MAX_OBSTRUCTION_LOOKS <= LAST_SEGMENTS and MAX_BROKEN_MOTIONS <= LAST_REQUESTS


def test_nothing_set_is_the_default() -> None:
    assert build_settings([]) == DEFAULT == Settings()


@pytest.mark.parametrize(("key", "value", "word"), [
    ("action.min_tolerence_px", "8", r"action\.min_tolerance_px.*harvey settings lists all"),
    ("tolerances.FLOOR_PX", "8", "expected one of"),
    ("action.min_tolerance_px", "off", "expected a number as 4, got 'off'"),
    ("action.min_tolerance_px", "nan", "expected a number"),
    ("action.min_tolerance_px", "inf", "expected a number"),
    ("action.max_looks", "2.5", "expected a whole number as 4, got '2.5'"),
    ("action.max_looks", "-1", "expected a whole number"),
    ("floor.use_ranges", "1", "expected on or off"),
])
def test_mistakes_are_named(key: str, value: str, word: str) -> None:
    with pytest.raises(BadInput, match=word):
        build_settings([(key, value)])


def test_no_setting_is_called_as_a_key_of_a_mission() -> None:
    """So --set knows which is meant."""
    from harvey.hardware.hardware_mission import FORMAT as HARDWARE
    from sim.scenario import FORMAT as SCENARIO

    assert not {*SCENARIO.keys(), *HARDWARE.keys()} & set(names())


@each_row
def test_harvey_settings_prints_it(row: Row, capsys: pytest.CaptureFixture[str]) -> None:
    """By its room, by its name and in the record; with value, unit, meaning and source."""
    for name in (row.room, row.name):
        assert main(["settings", name]) == 0
        told = " ".join(capsys.readouterr().out.split())
        assert row.field in told
        assert " ".join(format_value(row).split()) in told
    assert main(["settings", row.name, "--json"]) == 0
    (record,) = json.loads(capsys.readouterr().out)
    assert record == {"name": row.name, "value": row.value, "unit": row.unit, "meaning": row.what, "source": row.source}


def test_harvey_settings_prints_all_within_the_terminals_width(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for width in (120, 160):
        monkeypatch.setenv("COLUMNS", str(width))
        assert main(["settings"]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert max(map(len, lines)) <= width
        assert {line.split()[0] for line in lines if line.startswith("  ") and line[2] != " "} == {
            row.field for row in (*ROWS, *ROBOT_ROWS)}


def test_harvey_settings_names_near_rooms(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["settings", "actio"]) == 2
    assert "action" in capsys.readouterr().err
