"""A short mission on pixels, for laws that every mission must keep: across Allen's office."""

from __future__ import annotations

import pytest

from experiments.generated.missions import OFFICE
from sim.scenario import parse_scenario
from sim.stage import Stage, build_stage


@pytest.fixture(scope="session")
def short_stage() -> Stage:
    return build_stage(parse_scenario(OFFICE, "across-allens-office"))
