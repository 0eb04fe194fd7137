"""Scenario files and --set."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim.faults.built_in_faults import Kidnap, LightsOff
from sim.render.sensor import SensorParameters, expose
from sim.scenario import ScenarioError, load_scenario, parse_scenario, with_settings
from sim.scenario_names import list_scenarios
from world_models.entries import Place

MINIMAL = 'world = "w"\ngoal = "(ptrans (a (1,2,0)) (b (3.5,-4,0)))"\n'


def test_every_shipped_scenario_loads() -> None:
    shipped = set(list_scenarios())
    assert {"lab-to-allens-office", "hallway-kidnap", "bump", "lights-off", "forty-foot-hallway"} <= shipped
    assert all(load_scenario(name).description for name in list_scenarios())


def test_the_main_mission_is_figure_17s() -> None:
    scenario = load_scenario("lab-to-allens-office")
    assert scenario.goal == "(ptrans (robot-laboratory (16,2,0)) (allens-office (13,12,0)))"
    assert scenario.servo.action and scenario.servo.plan and scenario.servo.goal
    assert not scenario.arrival.matters


def test_faults_keep_their_order_and_kind() -> None:
    scenario = parse_scenario(MINIMAL + """
[[faults]]
kind = "lights_off"
after_s = 3.0
duration_s = 2.0
[[faults]]
kind = "kidnap"
in_locale = "b"
to_locale = "a"
to_x_ft = 10.0
to_heading_deg = 180.0
""")
    lights, kidnap = scenario.faults
    assert lights == LightsOff(after_s=3.0, duration_s=2.0)
    assert isinstance(kidnap, Kidnap) and kidnap.in_locale == "b"
    assert kidnap.destination == Place("a", 3.048, 0.0, pytest.approx(math.pi))


@pytest.mark.parametrize(("text", "message"), [
    ("", r"s\.toml:1: .*world"),
    (MINIMAL + "[servo]\nacton = true\n", r"s\.toml:4: servo\.acton: expected one of action.*acton"),
    (MINIMAL + "[servo]\naction = 1\n", r"s\.toml:4: servo\.action: expected true or false, got 1"),
    (MINIMAL + "[limits]\nmax_cycles = 2.5\n", r"s\.toml:4: limits\.max_cycles: expected a whole number, got 2\.5"),
    (MINIMAL + "[start]\nheading_deg = 1\nheading_rad = 1\n",
     r"s\.toml:5: start\.heading_rad: expected only one of heading_deg and heading_rad, got both"),
    (MINIMAL + '[[faults]]\nkind = "quake"\n',
     r"s\.toml:4: faults\.0\.kind: expected one of bump, .*, occluded, .*, got 'quake'"),
    (MINIMAL + '[[faults]]\nkind = "bumb"\n', r"s\.toml:4: faults\.0\.kind: expected one of bump, got 'bumb'"),
    (MINIMAL + '[[faults]]\nafter_s = 1\n',
     r"s\.toml:3: faults\.0: expected a table with the key 'kind', got \{after_s"),
    (MINIMAL + '[[faults]]\nkind = "lights_off"\nturn_deg = 40\n',
     r"s\.toml:5: faults\.0\.turn_deg: expected one of .*duration_s.*, got the key 'turn_deg'"),
    (MINIMAL + '[[faults]]\nkind = "stall"\npart = 0.5\n', r"s\.toml:5: faults\.0\.part: expected one of"),
    (MINIMAL + '[[faults]]\nkind = "bump"\nto_locale = "a"\n', r"s\.toml:5: faults\.0\.to_locale: expected one of"),
    (MINIMAL + '[[faults]]\nkind = "kidnap"\nto_x_ft = 2\n',
     r"s\.toml:3: faults\.0: expected to_locale beside .* to_x_m"),
    (MINIMAL + '[[faults]]\nkind = "kidnap"\nto_locale = "a"\nleft_m = 1\n',
     r"s\.toml:3: faults\.0: expected no displacement beside to_locale, got left_m"),
    (MINIMAL + "[actuator]\nspeed_m_per_s = 0\n", r"s\.toml:4: actuator\.speed_m_per_s: expected a number from 0.001"),
    (MINIMAL + "[render]\nsamples = 5\n", r"s\.toml:3: render: expected 1, 4, 8, 16 samples"),
    ('world = "w"\ngoal = "(go home)"\n', r"s\.toml:2: goal: expected a goal like"),
    ("world = \n", r"s\.toml:.*expected TOML"),
])
def test_a_malformed_scenario_is_pointed_at(text: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        parse_scenario(text, "s.toml")


@pytest.mark.parametrize(("line", "bounds"), [
    ("[start]\nput_down_sigma_in = -1", "from 0 to 78.7402"),
    ("[start]\nput_down_sigma_m = 1e9", "from 0 to 2"),
    ("[start]\nheading_deg = 361", "from -360 to 360"),
    ("[arrival]\nheading_deg = -1e6", "from -360 to 360"),
    ("[actuator]\nskitter_sigma_m = 1e9", "from 0 to 1"),
    ("[actuator]\ndistance_sigma = 1e9", "from 0 to 1"),
    ("[actuator]\nturn_sigma_deg = -0.1", "from 0 to 90"),
    ("[sensor]\nblur_px = 1e9", "from 0 to 50"),
    ("[sensor]\njpeg_quality = 0", "from 1 to 100"),
    ("[camera]\nmount_height_m = -1", "above 0, up to 5"),
    ("[camera]\nmount_height_ft = 0", "above 0, up to 16.4042"),
    ("[camera]\nfield_of_view_deg = 180", "from 2.86479 to 148.969"),
    ("[camera]\nwidth_px = 4097", "from 16 to 4096"),
    ("[camera]\nmount_tilt_deg = 91", "from -90 to 90"),
    ("[limits]\nmax_time_s = -3", "above 0, up to 1e+09"),
    ("[limits]\nmax_cycles = 0", "above 0, up to 1e+09"),
    ("[[rides]]\ntakes_s = -1", "from 0 to 1e+06"),
    ('[[moved]]\nx_m = 1e6', "from -1000 to 1000"),
    ("[[faults]]\nafter_ft = -7.0", "from 0 to"),
    ("[[faults]]\nleft_m = 1e6", "from -5 to 5"),
    ("[[faults]]\nduration_s = 0", "above 0"),
    ("[[faults]]\npart = 1", "above 0, up to 0.99"),
])
def test_settings_out_of_all_bounds_are_refused_where_they_stand(line: str, bounds: str) -> None:
    key, _, came = line.splitlines()[1].partition(" = ")
    kinds = {"duration_s": "lights_off", "part": "occluded"}
    rest = "thing = 'a/b'\n" if "moved" in line else f"kind = '{kinds.get(key, 'bump')}'\n" if "faults" in line else ""
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(f"{MINIMAL}{line}\n{rest}", "s.toml")
    assert str(caught.value).startswith("s.toml:4: ")
    assert f".{key}: expected a " in str(caught.value) and f" {bounds}" in str(caught.value)
    assert str(caught.value).endswith(f", got {float(came) if 'e' in came else came}")


def test_a_blur_within_bounds_can_be_seen_through() -> None:
    for blur_px in (1e-300, 0.1, 50.0):
        parameters = SensorParameters(blur_px=blur_px)
        assert expose(np.ones((16, 16, 3), np.float32), parameters, np.random.default_rng(1)).shape == (16, 16, 3)


def test_an_unknown_scenario_names_near_ones() -> None:
    with pytest.raises(ScenarioError, match="lab-to-allens-office"):
        load_scenario("lab-to-alens-ofice")
    with pytest.raises(ScenarioError, match="readable file"):
        load_scenario("nowhere/at-all.toml")


def test_settings_are_typed_and_leave_the_original_alone() -> None:
    scenario = load_scenario("bump")
    changed = with_settings(scenario, {"servo.action": "off", "start.heading_deg": "-90", "limits.max_cycles": "7",
                                       "actuator.shortfall_low": 0.05})
    assert not changed.servo.action and changed.servo.plan and scenario.servo.action
    assert changed.start.heading_rad == pytest.approx(-math.pi / 2)
    assert changed.start.put_down_sigma_m == scenario.start.put_down_sigma_m
    assert (changed.limits.max_cycles, changed.actuator.shortfall_low) == (7, 0.05)
    assert changed.faults == scenario.faults


@pytest.mark.parametrize(("key", "value", "message"), [
    ("servo.acton", "off", "servo.action"),
    ("servo.action", "maybe", "expected true or false, got 'maybe'"),
    ("actuator.shortfall_low", "0.9", "low <= high"),
    ("limits.max_cycles", "many", "whole number"),
    ("limits.max_cycles", "99999999999999999999999", "expected a whole number from -1000000000 to 1000000000, got 9"),
    ("limits.max_time_s", "-3", "max_time_s: expected a number above 0, up to 1e.09, got -3"),
    ("start.put_down_sigma_in", "-1", "put_down_sigma_in: expected a number from 0 to 78.7402, got -1"),
    ("start.heading_deg", "1979-05-27", "expected a number from .*, got 1979-05-27"),
    ("camera.distortion", "[0.1, -1e9, 0, 0]", "expected distortion coefficients of at most 10000 in size"),
    ("goal", "home", "expected a goal like"),
    ("start", "3", "expected one of"),
])
def test_a_bad_setting_is_refused(key: str, value: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message) as caught:
        with_settings(load_scenario("bump"), {key: value})
    assert str(caught.value).startswith(f"--set {key}: ")
