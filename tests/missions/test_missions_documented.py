"""The missions that documents show are driven as they stand there, to the last digit."""

from __future__ import annotations

import gc
import json

import harvey
from blackboard import Blackboard
from docs.tools.status import LADDER_FILE, SEEDS, SEEDS_FILE, drive_ladder, drive_seed


def test_missions_of_the_tables_come_out_as_they_stand_there() -> None:
    """Where decisions changed, ``python -m docs.tools.status`` and ``python -m docs.tools.fill`` write it again."""
    missions = json.loads(SEEDS_FILE.read_text(encoding="utf-8"))["missions"]
    assert list(missions) == [str(seed) for seed in SEEDS]
    assert drive_seed(2) == missions["2"]
    assert drive_ladder() == json.loads(LADDER_FILE.read_text(encoding="utf-8"))["rows"]


def test_a_process_keeps_nothing_of_the_missions_that_it_drove() -> None:
    def count_kept(seed: int) -> tuple[int, int]:
        harvey.run("docs/flat/flat-sim.toml", seed=seed)
        gc.collect()
        kept = gc.get_objects()
        return sum(isinstance(one, Blackboard) for one in kept), len(kept)

    (boards, before), (boards_then, then) = (count_kept(seed) for seed in (0, 1))
    assert boards_then == boards and then - before < 5000  # caches may fill
