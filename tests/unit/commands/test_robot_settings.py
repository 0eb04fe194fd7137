"""What the robot believes of itself can be set: each value alone, within its bounds, in several units."""

from __future__ import annotations

import json
import math
from dataclasses import fields
from typing import Any

import pytest

from harvey.agent_settings import (
    KEYS,
    VALUES,
    RobotValue,
    build_believed,
    build_settings,
    list_robot_rows,
    split_settings,
)
from harvey.cli import main
from harvey.errors import BadInput
from knowledge_sources.settings import DEFAULT
from world_models.actuator import ActuatorModel
from world_models.camera import Camera, CameraMount
from world_models.entries import CameraState, Footprint, Wheels
from world_models.units import bounds_of

ENTRIES = (CameraState(Camera(500.0, 500.0, 255.5, 255.5, 512, 512), CameraMount(1.0, 0.1)), Wheels(ActuatorModel()),
           Footprint(0.35))
each_value = pytest.mark.parametrize("value", VALUES, ids=[value.row.name for value in VALUES])


def numbers(entry: Any) -> dict[str, Any]:
    """Every number of an entry, by the name of its attribute and, in it, of its field."""
    if isinstance(entry, Footprint):
        return {"radius_m": entry.radius_m, "sigma_m": entry.sigma_m}
    parts = ("lens", "mount") if isinstance(entry, CameraState) else ("actuator",)
    return {f"{part}.{f.name}": getattr(getattr(entry, part), f.name)
            for part in parts for f in fields(getattr(entry, part))}


@each_value
def test_setting_one_changes_it_and_nothing_else(value: RobotValue) -> None:
    number = value.bounds.low + 0.5 * (min(value.bounds.high, 2.0) - value.bounds.low) + 0.01
    believed = build_believed([(value.row.name, repr(number))])
    changed = [(now, then) for now, then in zip(map(believed, ENTRIES), ENTRIES, strict=True) if now is not then]
    ((now, then),) = changed
    name = f"{value.part}.{value.field}".lstrip(".")
    assert numbers(now) == {**numbers(then), name: number}


@each_value
def test_what_is_so_already_is_the_same_object(value: RobotValue) -> None:
    """So a camera that is set to what it is makes no revision."""
    entry = next(entry for entry in ENTRIES if isinstance(entry, value.kind))
    name = f"{value.part}.{value.field}".lstrip(".")
    assert build_believed([(value.row.name, repr(numbers(entry)[name]))])(entry) is entry


def test_all_of_the_wheels_can_be_set() -> None:
    names = {value.field for value in VALUES if value.kind is Wheels}
    assert names == set(bounds_of(ActuatorModel)) == {f.name for f in fields(ActuatorModel)}


def test_units() -> None:
    believed = build_believed([("camera.tilt_deg", "2"), ("camera.height_in", "40"), ("footprint.radius_ft", "1")])
    camera, _, footprint = map(believed, ENTRIES)
    assert camera.mount.tilt_rad == pytest.approx(math.radians(2.0))
    assert camera.mount.height_m == pytest.approx(1.016) and footprint.radius_m == pytest.approx(0.3048)


def test_they_are_no_settings_of_the_methods_and_are_kept_beside_them() -> None:
    assert build_settings([("camera.tilt_deg", "2")]) == DEFAULT
    of_mission, numbers = split_settings({"camera.tilt_deg": 2.0, "servo.plan": False}, ("servo.plan",))
    assert (of_mission, numbers) == ({"servo.plan": False}, (("camera.tilt_deg", "2.0"),))


@pytest.mark.parametrize(("key", "value", "word"), [
    ("camera.tilt_dag", "2", r"one of camera\.tilt_deg.*harvey settings lists all"),
    ("camera.tilt_deg", "95", "expected a number from -90 to 90, got '95'"),
    ("camera.height_m", "0", "expected a number above 0, up to 5, got '0'"),
    ("camera.fx_px", "far", "expected a number from 1 to 100000, got 'far'"),
    ("wheels.reach", "on", "expected a number from 0.1 to 2, got 'on'"),
    ("footprint.radius_m", "nan", "expected a number"),
])
def test_mistakes_are_named(key: str, value: str, word: str) -> None:
    with pytest.raises(BadInput, match=word):
        build_settings([(key, value)])


def test_harvey_settings_lists_them(capsys: pytest.CaptureFixture[str]) -> None:
    for row in list_robot_rows():
        assert main(["settings", row.name, "--json"]) == 0
        (record,) = json.loads(capsys.readouterr().out)
        assert record == {"name": row.name, "value": row.value, "unit": row.unit, "meaning": row.what, "source": "§3.2"}
        assert len(row.what.split()) >= 3 and row.what.endswith(".")
    assert main(["settings", "camera.tilt_deg"]) == 0
    assert "tilt_rad" in capsys.readouterr().out
    assert len(KEYS) == len(set(KEYS))
