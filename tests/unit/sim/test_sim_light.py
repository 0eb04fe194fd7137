"""Light in scenarios and in the simulated body: settings, recorded pictures, states of the building."""

from __future__ import annotations

import math

import numpy as np
import pytest

from experiments.generated.scenes import box_room
from sim.body.collision import Obstacles
from sim.body.simulated_body import SimulatedBody
from sim.body.simulated_building import SimulatedBuilding
from sim.render.light.lamps import Room
from sim.render.light.lighting import Lighting
from sim.render.light.lights import Lights
from sim.render.light.lit_renderer import LitRenderer
from sim.scenario import ScenarioError, parse_scenario, with_settings
from sim.stage import build_stage
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2

MINIMAL = 'world = "research_center"\ngoal = "(ptrans (hallway (4,4,0)) (hallway (24,4,0)))"\n'
LIGHTING = Lighting(lamps=0.3, lamp_colour=(1.2, 1.0, 0.8), exposure_lag_s=0.5, white_balance_lag_s=0.5, vignetting=0.3)
ROOM = Room(np.array([(0.0, 0.0), (6.0, 0.0), (6.0, 4.0), (0.0, 4.0)]), 0.0, 2.6)


def lit_body() -> SimulatedBody:
    building = SimulatedBuilding(Lights(LIGHTING, (ROOM,)).renderer(box_room(), 4), Obstacles.of_faces(box_room()))
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


def test_a_lit_stage_has_lamps_in_its_rooms() -> None:
    stage = build_stage(parse_scenario(MINIMAL + "[light]\nrays = 4\ncell_m = 1.0\nbounces = 1\n"))
    renderer = stage.building.renderer
    assert isinstance(renderer, LitRenderer)
    plain = build_stage(parse_scenario(MINIMAL)).building.renderer
    assert len(renderer.mesh) > len(plain.mesh)
    assert np.isfinite(renderer.baked.seen_light).all()
