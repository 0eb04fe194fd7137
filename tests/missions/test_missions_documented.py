"""The missions that README shows are driven as they stand there, to the last digit."""

from __future__ import annotations

import json

from docs.tools.status import SEEDS, SEEDS_FILE, drive_seed


def test_a_mission_of_the_table_comes_out_as_it_stands_there() -> None:
    """Where decisions changed, ``python -m docs.tools.status`` and ``python -m docs.tools.fill`` write it again."""
    missions = json.loads(SEEDS_FILE.read_text(encoding="utf-8"))["missions"]
    assert list(missions) == [str(seed) for seed in SEEDS]
    assert drive_seed(2) == missions["2"]
