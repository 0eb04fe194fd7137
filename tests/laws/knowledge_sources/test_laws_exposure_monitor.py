"""Laws of the exposure monitor: what explains dark and white pictures; of others nothing is told."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Entry
from generated_boards import Bench, effect_on
from harvey.testing import check_source, plain_robot
from knowledge_sources.methods.belief import weigh_rivals
from knowledge_sources.senses.exposure_monitor import exposure_monitor
from world_models.entries import CameraPicture, Evidence, RivalKind, Segments

BLACK, DIM, PLAIN, WHITE = 0.0, 0.02, 1.0, 12.0


def see(bench: Bench, gain: float, seed: int = 0) -> Entry[Segments]:
    """A picture of steps of grey at a gain, with noise; a bare wall is one in which they are next to none."""
    rng = np.random.default_rng(seed)
    steps = np.kron(rng.uniform(40.0, 200.0, (6, 8)), np.ones((40, 40)))
    image = np.clip(gain * steps + rng.normal(0.0, 0.5, steps.shape), 0.0, 255.0).astype(np.uint8)
    jpeg = bytes(cv2.imencode(".jpg", image)[1])
    frame = bench.put(CameraPicture(jpeg, seed, 1.0 + seed))
    nothing = np.zeros((0, 2, 2)), np.zeros(0)
    return bench.put(Segments(frame.id, "", *nothing, float(image.std()), float(image.mean())), frame)


def tell(gains: Sequence[float], seed: int) -> list[Evidence]:
    """What is told of pictures, each after those before."""
    bench, told = Bench(plain_robot()), list[Evidence]()
    bench.believe()
    for number, gain in enumerate(gains):
        effects = bench.ask(exposure_monitor, see(bench, gain, seed + number))
        if effects:
            told.append(effect_on(effects, Evidence).value)
            bench.put(weigh_rivals(told[-1].about, told))
    return told


@settings(max_examples=15, deadline=None)
@given(st.sampled_from([(BLACK, "cover"), (DIM, "lamp"), (WHITE, "exposure")]), st.integers(0, 99))
def test_what_explains_such_pictures_is_sure_by_some_and_not_by_one_and_a_good_picture_acquits_it(
    case: tuple[float, RivalKind], seed: int
) -> None:
    gain, kind = case
    told = tell([gain] * 4 + [PLAIN] * 3, seed)
    assert len(told) == 7
    first, some, after = (weigh_rivals(told[0].about, told[:count]) for count in (1, 4, 7))
    assert some.is_sure and some.leader.kind == kind and not first.is_sure
    assert not after.is_sure and some.p_misled == 0.0  # nothing was certified wrongly by it


@settings(max_examples=15, deadline=None)
@given(st.floats(0.3, 1.2), st.integers(0, 99))
def test_of_pictures_with_light_and_shade_nothing_is_told(gain: float, seed: int) -> None:
    assert not tell([gain] * 3, seed)


@pytest.mark.parametrize("gain", [BLACK, WHITE])
def test_it_keeps_the_laws_of_all_sources(gain: float) -> None:
    bench = Bench(plain_robot())
    bench.believe()
    check_source(exposure_monitor, bench, see(bench, gain), without=("CameraPicture-1",))
