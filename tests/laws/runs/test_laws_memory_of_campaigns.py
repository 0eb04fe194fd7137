"""A process that drives many missions keeps nothing of the buildings that it has left."""

from __future__ import annotations

import gc
import weakref
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from box_rooms import generate_house
from harvey.campaign.workers import return_memory
from knowledge_sources.methods.verification.predicted_colors import _build_surfaces, _find_surfaces
from logs.run_head import load_known_world
from world_models.files.toml.source import Source
from world_models.files.world_files import WORLDS, load_world, read_world


def test_a_building_is_kept_until_two_others_were_read(tmp_path: Path) -> None:
    files = [tmp_path / f"copy{number}.toml" for number in range(3)]
    for file in files:
        file.write_text(f"# {file.name}\n" + (WORLDS / "two_ways.toml").read_text(encoding="utf-8"), encoding="utf-8")
    first = weakref.ref(load_known_world(files[0]))
    assert load_known_world(files[0]) is first()
    for file in files[1:]:
        load_known_world(file)
    return_memory()
    assert first() is None
    assert load_world(files[2]) is load_known_world(files[2])


@settings(deadline=None, max_examples=5)
@given(st.integers(0, 10_000))
def test_surfaces_of_a_locale_are_computed_once_and_go_with_it(seed: int) -> None:
    world = read_world(Source.parse(generate_house(np.random.default_rng(seed)), "house.toml"))
    packets = [packet for name in world.rooms for packet in world.frame(name).parts]
    assert packets
    for packet in packets:
        found = _find_surfaces(packet)
        assert _find_surfaces(packet) is found
        assert all(np.array_equal(a, b) for a, b in zip(found, _build_surfaces(packet), strict=True))
    kept = [weakref.ref(packet) for packet in packets]
    del world, packets, packet
    gc.collect()
    assert not any(packet() for packet in kept)
