"""All of a building moves: turned, shifted and lifted, each place of each frame moves with it, also what was found."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial import KDTree

from harvey.testing import HALL, HOUSE
from world_models.building.locale_frame import FrameChange, LocaleFrame
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world
from world_models.frame_store import FrameStore
from world_models.frames import Pose

Points = NDArray[np.float64]
BOX = ((3.0, 1.0), (3.4, 1.0), (3.4, 1.3), (3.0, 1.3))
"""Of something that the file lacks, in the hall's frame [m]."""


def build(x_m: float, y_m: float, z_m: float, turn_deg: float) -> FrameStore:
    text = HOUSE.replace("at = [3, -2]", f"at = [{x_m!r}, {y_m!r}, {z_m!r}]")
    return FrameStore(read_world(Source.parse(text.replace("turn = 30", f"turn = {turn_deg!r}"), "house.toml")))


def changed(store: FrameStore, what: str) -> LocaleFrame:
    """The hall's frame with something believed differently."""
    frame, to_world = store.frame(HALL), store.world.world_from_locale(HALL)
    corners = tuple((float(x), float(y)) for x, y, _ in to_world.apply(np.array([(*corner, 0.0) for corner in BOX])))
    change = FrameChange("extra", "hall/obstacle-1", "a law", corners, 0.8) if what == "extra" else (
        FrameChange("shut", "study-door", "a law"))
    return frame if what == "nothing" else frame.changed(change)


def list_points(frame: LocaleFrame) -> list[Points]:
    """All places that a frame states, (.., 3) [m, world]: of its faces and landmarks, and of its things."""
    shown = [array for part in frame.parts for array in (part.scene.corners_world, part.scene.polygons_world)]
    upright = [np.column_stack([np.tile(thing.footprint_world, (2, 1)), np.repeat(
        [frame.extent.reach[2] + thing.low_m, frame.extent.reach[2] + thing.high_m], len(thing.footprint_world))])
        for thing in frame.things]
    return [array.reshape(-1, 3) for array in (*shown, *upright) if array.size]


@pytest.mark.parametrize("what", ["nothing", "extra", "shut"])
@settings(max_examples=5, deadline=None)
@given(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.sampled_from((-3.2, 0.0, 3.6)), st.floats(-180.0, 180.0))
def test_each_place_of_a_frame_moves_with_its_building(
    what: str, x_m: float, y_m: float, z_m: float, turn_deg: float
) -> None:
    here, there = build(3.0, -2.0, 0.0, 30.0), build(x_m, y_m, z_m, turn_deg)
    by: Pose = there.world.world_from_locale(HALL) @ here.world.world_from_locale(HALL).inverse()
    one, other = list_points(changed(here, what)), list_points(changed(there, what))
    assert sum(map(len, one)) > 40
    for before, after in zip(one, other, strict=True):
        moved = by.apply(before)  # at which corner of a thing it begins is free
        assert max(KDTree(moved).query(after)[0].max(), KDTree(after).query(moved)[0].max()) < 1e-6
