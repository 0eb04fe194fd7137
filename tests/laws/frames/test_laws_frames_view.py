"""Decisions depend on nothing but the view: acts are run again on a board that is rebuilt from the journal."""

from __future__ import annotations

from harvey.run_files.run_directory import RunDirectory
from rebuilt_board import rebuild, recorded_act


def test_acts_are_the_same_on_a_board_that_is_rebuilt_from_the_journal(told_run: RunDirectory) -> None:
    """By a knowledge source made for this act, in a world that was read anew: to the byte, with what it read."""
    acted = set[str]()
    for rebuilt, decision in rebuild(told_run):
        assert rebuilt.act_again(decision) == recorded_act(decision), decision.cycle
        acted |= {decision.chosen.source} if decision.chosen else set()
    assert {"model_reviser", "withdrawer", "sketcher", "motor", "correlator_tracker", "matcher"} <= acted


def test_acts_are_the_same_where_nothing_is_kept_that_was_computed_before(told_run: RunDirectory) -> None:
    """Caches change how long an act takes, and neither what it makes nor what it is said to have read."""
    for rebuilt, decision in rebuild(told_run):
        rebuilt.clear_memos()
        assert rebuilt.act_again(decision) == recorded_act(decision), decision.cycle
