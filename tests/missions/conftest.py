"""A short mission on pixels, for laws that every mission must keep: across Allen's office."""

from __future__ import annotations

import pytest

from harvey.experiments.short_missions import OFFICE
from sim.assembly import Stage, set_stage
from sim.scenario import parse_scenario


@pytest.fixture(scope="session")
def short_stage() -> Stage:
    return set_stage(parse_scenario(OFFICE, "across-allens-office"))
