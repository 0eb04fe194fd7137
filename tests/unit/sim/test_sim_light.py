"""Light in scenarios and in the simulated body: settings, recorded pictures, states of the building."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from box_rooms import box_room
from harvey.cli import main
from sim.body.collision import Obstacles
from sim.body.simulated_body import SimulatedBody
from sim.body.simulated_building import SimulatedBuilding
from sim.render.lighting import Lighting
from sim.render.lights import Lights
from sim.scenario import ScenarioError, parse_scenario, with_settings
from sim.stage import build_stage
from world_models import plugins
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2

MINIMAL = 'world = "research_center"\ngoal = "(ptrans (hallway (4,4,0)) (hallway (24,4,0)))"\n'
LIGHTING = Lighting(flat=0.1, lamps=0.0, exposure_lag_s=0.5, white_balance_lag_s=0.5, vignetting=0.3)


def lit_body() -> SimulatedBody:
    building = SimulatedBuilding(Lights(LIGHTING).renderer(box_room(), 4), Obstacles.of_faces(box_room()))
    return SimulatedBody(building, Pose2(1.5, 2.0, 0.0), Camera.from_field_of_view(math.radians(65.0), 128, 128),
                         CameraMount(1.0, 0.1), seed=3, lighting=LIGHTING)


def take_pictures(body: SimulatedBody) -> list[bytes]:
    pictures = []
    for _ in range(5):
        pictures.append(body.look().jpeg)
        body.turn(0.5)
    return pictures


def test_pictures_after_recorded_ones_are_those_that_would_have_been_taken() -> None:
    whole = take_pictures(lit_body())
    resumed = lit_body()
    resumed.use_recorded(dict(enumerate(whole[:3])))
    assert take_pictures(resumed) == whole


def test_a_picture_that_is_not_counted_changes_no_later_exposure() -> None:
    body, other = lit_body(), lit_body()
    body.look(), other.look()
    before = other._camera._exposure
    other.picture()
    assert other._camera._exposure == before == body._camera._exposure


def test_light_is_read_and_can_be_set() -> None:
    plain = parse_scenario(MINIMAL)
    assert plain.light is None
    sunny = with_settings(plain, {"light.sun": 5.0, "light.sun_azimuth_deg": 90.0})
    assert sunny.light == Lighting(sun=5.0, sun_azimuth_rad=math.pi / 2.0)
    assert parse_scenario(MINIMAL + "[light]\nlamp_colour = [1.0, 0.9, 0.8]\n").light == Lighting(
        lamp_colour=(1.0, 0.9, 0.8))


@pytest.mark.parametrize(("line", "told"), [
    ("lamps_off = 1.5", r"light\.lamps_off: expected a number from 0 to 1"), ("lamp = 1", "expected one of .*lamps"),
    ("lamp_colour = [1.0]", "expected lamp_colour of three numbers"), ("sun_elevation_deg = -5", "sun_elevation_deg"),
])
def test_bad_light_is_refused(line: str, told: str) -> None:
    with pytest.raises(ScenarioError, match=told):
        parse_scenario(f"{MINIMAL}[light]\n{line}\n")


@pytest.mark.parametrize(("line", "asked"), [("", "lamps"), ("lamps = 0\nsun = 5.0\nglass = 1.0", "sun, glass")])
def test_without_the_extra_light_that_is_uneven_says_what_to_install(
    line: str, asked: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(plugins, "entry_points", lambda group: ())
    path = tmp_path / "lit.toml"
    path.write_text(f"{MINIMAL}[light]\n{line}\n", encoding="utf-8")
    assert main(["run", str(path)]) == 2
    assert capsys.readouterr().err.endswith(f"\nharvey: {path}:3: light: with {asked} it needs harvey-light:"
                                            " pip install ./extras/harvey-light\n")


def test_light_that_is_even_needs_no_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plugins, "entry_points", lambda group: ())
    dim, plain = (build_stage(parse_scenario(MINIMAL + light)).building.renderer
                  for light in ("[light]\nflat = 0.2\nlamps = 0.0\n", ""))
    assert dim.brightness == 0.2 ** (1.0 / 2.2) and plain.brightness == 1.0
    assert len(dim.mesh) == len(plain.mesh)
