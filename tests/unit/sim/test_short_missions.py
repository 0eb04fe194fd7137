"""The short missions that experiments and tests share can be read, with every fault that is put into them."""

from __future__ import annotations

import pytest

from experiments.robustness.crash import DECISIONS, FULL, MAIN, QUICK, TEXTS
from sim.scenario import parse_scenario


@pytest.mark.parametrize("name", TEXTS)
def test_they_are_scenarios(name: str) -> None:
    scenario = parse_scenario(TEXTS[name], name)
    assert len(scenario.faults) == ("," in name)


def test_every_one_that_is_to_be_killed_is_known() -> None:
    assert set(FULL) == set(DECISIONS) == {*TEXTS, MAIN} and set(QUICK) <= set(FULL)
