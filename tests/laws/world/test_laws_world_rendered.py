"""The law of visibility: model and renderer, which share no code, agree on what is hidden in made-up houses."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.generated.scenes import generate_house
from experiments.perception.visibility import MIN_AGREEMENT, count_agreement
from world_models.building.checks import check_world
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world

POINTS = 4_000
"""In all: enough that a part of a thousandth is several points."""


def test_the_model_agrees_with_the_renderer_on_what_is_hidden() -> None:
    same = asked = 0
    for number in range(5):
        more = count_agreement(np.random.default_rng([7, number]), views=5, rays=220)
        same, asked = same + more[0], asked + more[1]
    assert asked > POINTS
    assert same >= MIN_AGREEMENT * asked, f"{asked - same} of {asked} points"


@settings(deadline=None, max_examples=6)
@given(st.integers(0, 10_000))
def test_made_up_houses_are_sound_but_for_things_that_stand_through_walls(seed: int) -> None:
    faults = check_world(read_world(Source.parse(generate_house(np.random.default_rng(seed)), "house.toml")))
    assert all("expected it inside" in fault.what for fault in faults), faults
