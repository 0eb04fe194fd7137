"""A short mission on pixels, for laws that every mission must keep: across Allen's office."""

from __future__ import annotations

import pytest

from sim.assembly import Stage, set_stage
from sim.scenario import parse_scenario

SHORT = """
description = "Across Allen's office."
world = "research_center"
details = ["research_center_details"]
goal = "(ptrans (allens-office (7,4,0)) (allens-office (13,12,0)))"

[start]
heading_deg = 60.0
put_down_sigma_m = 0.02
put_down_sigma_deg = 1.0

[limits]
max_cycles = 600
"""


@pytest.fixture(scope="session")
def short_stage() -> Stage:
    return set_stage(parse_scenario(SHORT, "across-allens-office"))
