"""The fast renderer against the path tracer, which needs Mitsuba."""

from __future__ import annotations

import importlib.util
import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from box_rooms import box_room
from harvey_light.baked import BakedRenderers
from sim.render.lighting import Lighting
from sim.render.lights import Room
from sim.scenario import ScenarioError, parse_scenario
from sim.stage import build_stage
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2

ROOM = Room(np.array([(0.0, 0.0), (6.0, 0.0), (6.0, 4.0), (0.0, 4.0)]), 0.0, 2.6)
CAMERA = Camera.from_field_of_view(math.radians(65.0), 96, 96)
MINIMAL = 'world = "research_center"\ngoal = "(ptrans (hallway (4,4,0)) (hallway (24,4,0)))"\n'
HAS_MITSUBA = importlib.util.find_spec("mitsuba") is not None


def test_a_scenario_that_needs_the_path_tracer_is_refused_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("harvey_light.baked.find_spec", lambda name: None)
    with pytest.raises(ScenarioError, match=r"light: with traced_paths it needs Mitsuba: pip install"):
        build_stage(parse_scenario(MINIMAL + "[light]\ntraced_paths = 8\n"))


@pytest.mark.skipif(not HAS_MITSUBA, reason="Mitsuba is not installed")
@pytest.mark.parametrize("gloss", [0.0, 1.0])
def test_the_fast_renderer_is_as_bright_as_the_path_tracer(tmp_path: Path, gloss: float) -> None:
    pose = CameraMount(1.0, 0.1).camera_from_robot @ Pose2(0.6, 1.5, 0.1).lifted().inverse()
    pictures = []
    for paths in (0, 24):
        lighting = Lighting(lamps=0.8, floor_gloss=gloss, bounces=6, rays=256, cell_m=0.2, traced_paths=paths)
        renderer = BakedRenderers(tmp_path).build(box_room(), lighting, [ROOM])
        pictures.append(renderer.radiance(CAMERA, pose))
        assert np.array_equal(renderer.radiance(CAMERA, pose), pictures[-1]), "a picture that is kept is the same"
    fast, traced = (np.minimum(cv2.GaussianBlur(picture, (0, 0), 3.0), 1.0) for picture in pictures)
    ratio = np.log((fast + 0.02) / (traced + 0.02))
    assert abs(float(np.median(ratio))) < 0.06
    assert float(np.percentile(np.abs(ratio), 90.0)) < 0.15
    assert len(list(tmp_path.glob("*.npy"))) == 1
