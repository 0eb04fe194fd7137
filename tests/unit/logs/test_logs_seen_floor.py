"""What is seen of the floor and of what stands on it is drawn where it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from logs.recording.loggers.surroundings.found import UNKNOWN_HEIGHT_M, colour_of, edges, outlines
from logs.recording.palette import EXPECTED, REJECTED
from world_models.entries import FreeFloor, Obstacle

BOX = Obstacle("hallway/obstacle-1", "hallway", ((0.0, 0.0), (1.0, 0.0), (1.0, 0.5), (0.0, 0.5)), 0.05, 0.5, 0.25, 1.0,
               height_m=0.4, sigma_height_m=0.1)


def test_an_obstacle_is_as_high_as_it_is_known_to_be() -> None:
    strips = [*edges(BOX, 3.0)]
    assert len(strips) == 2 + len(BOX.footprint)
    assert np.allclose(strips[0][:, 2], 3.4) and np.allclose(strips[1][:, 2], 3.0)
    flat = [*edges(replace(BOX, sigma_height_m=np.inf), 3.0)]
    assert np.allclose(flat[0][:, 2], 3.0 + UNKNOWN_HEIGHT_M)


def test_an_obstacle_is_the_redder_the_more_certain_it_is() -> None:
    assert colour_of(replace(BOX, certainty=1.0))[:3] == REJECTED[:3]
    assert colour_of(replace(BOX, certainty=0.5))[:3] == EXPECTED[:3]
    assert colour_of(BOX)[3] > colour_of(replace(BOX, status="suspected"))[3]


def test_free_floor_is_outlined_where_it_is_free() -> None:
    floor = FreeFloor("camera", "hallway", 1.0, 2.0, (0.0, 0.1, 0.2, 0.3, 0.4), (1.0, 1.0, 1.0, 1.0, 1.0),
                      (2.0, 3.0, 0.5, 2.0, 2.0), ("thing", "sight", "thing", "sight", "model"), (0.1,) * 5, (), 0.0)
    outline, other = outlines(floor)
    assert np.allclose(outline[0], outline[-1])
    assert np.allclose(sorted(np.hypot(*(outline[:-1] - (1.0, 2.0)).T)), [1.0, 1.0, 2.0, 3.0])
    assert len(other) == 5
    assert outlines(replace(floor, far_m=(0.0,) * 5)) == []
