"""Scenario texts of missions that take seconds, for tests and for experiments with many missions."""

from __future__ import annotations

OFFICE = """
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
"""About 45 decisions."""

HALLWAY = """
description = "Along the hallway."
world = "research_center"
details = ["research_center_details"]
goal = "(ptrans (hallway (4,4,0)) (hallway (24,4,0)))"

[start]
heading_deg = 0.0
put_down_sigma_in = 0.5
"""
"""About 120 decisions."""


def fault(kind: str, in_locale: str, after_ft: float, **more: float) -> str:
    """The text of one ``[[faults]]``, to be appended to a scenario: ``fault("bump", "hallway", 7.0, left_m=0.3)``.

    ``in_locale`` "" is anywhere; ``more`` are the fault's own keys.
    """
    where = [f'in_locale = "{in_locale}"'] if in_locale else []
    lines = [f'kind = "{kind}"', *where, f"after_ft = {after_ft}"]
    return "\n".join(["", "[[faults]]", *lines, *(f"{name} = {value}" for name, value in more.items()), ""])
