"""What is seen of the floor and of what stands on it is drawn where it is."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from knowledge_sources.methods.floor import CELL_M, FloorMap
from logs.recording.loggers.surroundings.found import UNKNOWN_HEIGHT_M, colour_of, edges
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


def test_the_map_of_the_floor_is_drawn_where_it_is() -> None:
    floor = FreeFloor("camera", "hallway", 1.0, 2.0, (-0.2, 0.0, 0.2), (1.0, 1.0, 1.0), (2.0, 2.0, 2.0),
                      ("thing", "thing", "thing"), (0.1,) * 3, (), 0.0)
    (x_m, y_m), cells = FloorMap([floor], np.zeros((0, 3))).draw()

    def tell(x: float, y: float) -> int:
        return int(cells[len(cells) - 1 - math.floor((y - y_m) / CELL_M), math.floor((x - x_m) / CELL_M)])

    assert tell(2.5, 2.02) == tell(2.3, 1.9) == 5 and tell(3.1, 2.02) == 95 and tell(2.1, 2.3) == 255
    assert set(FloorMap([], np.zeros((0, 3))).draw()[1].ravel()) == {255}
