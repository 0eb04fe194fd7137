"""Constants of the experts: which may be set, and that setting one holds wherever it is read, for a while only."""

from __future__ import annotations

import pytest

from harvey.errors import BadInput
from harvey.replay.constants import constants, set_for_a_while
from knowledge_sources import tolerances
from knowledge_sources.methods.features import lines


def test_stated_numbers_of_experts_and_methods_are_found() -> None:
    known = constants()
    assert {"motor.LOOKAHEAD_M", "tolerances.FLOOR_PX", "tolerances.PLAN_PX", "matcher.RIGID_PX"} <= set(known)
    assert not any(name.split(".")[1].startswith("_") for name in known)


def test_one_is_set_wherever_it_is_read_and_then_as_before() -> None:
    name = "lines.SIGMA_ACROSS_PX"
    places = constants()[name].places
    assert len(places) >= 3
    before = lines.SIGMA_ACROSS_PX
    with set_for_a_while([(name, "1.5"), ("tolerances.FLOOR_PX", "8")]):
        assert tolerances.FLOOR_PX == 8.0
        assert all(getattr(__import__(module, fromlist=[alias]), alias) == 1.5 for module, alias in places)
    assert before == lines.SIGMA_ACROSS_PX
    assert constants()["tolerances.FLOOR_PX"].value == tolerances.FLOOR_PX


def test_it_is_as_before_after_a_mistake_too() -> None:
    before = tolerances.FLOOR_PX
    with pytest.raises(RuntimeError), set_for_a_while([("tolerances.FLOOR_PX", "8")]):
        raise RuntimeError
    assert before == tolerances.FLOOR_PX


@pytest.mark.parametrize(("key", "value", "word"), [
    ("tolerances.FLOR_PX", "8", "tolerances.FLOOR_PX"),
    ("tolerances.FLOOR_PX", "off", "expected a number"),
    ("tolerances.FLOOR_PX", "nan", "expected a number"),
])
def test_mistakes_are_named(key: str, value: str, word: str) -> None:
    with pytest.raises(BadInput, match=word), set_for_a_while([(key, value)]):
        pass
