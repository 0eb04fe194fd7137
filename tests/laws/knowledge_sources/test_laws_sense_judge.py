"""Laws of the sense judge: a sense that misleads is doubted, looked at again, and then the mission ends by its name."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from blackboard import Level
from generated_boards import Bench, made, reasons
from harvey.testing import check_source
from knowledge_sources.senses.sense_judge import WRONG, sense_judge
from world_models.entries import MISLEADING, RISK, SENSES, Discrepancy, Impasse
from world_models.entries.difference import SURE, Difference, Evidence, Explanation, Rival, RivalKind


def differ(kind: RivalKind, p: float) -> Difference:
    """A difference that is taken for a rival with this probability."""
    rivals = Rival(kind, "it is so", 3.0, p), Rival("chance", "chance", 0.0, 1.0 - p)
    seen = Evidence("camera", "lines", (Explanation(kind, "it is so", 3.0),), 0.0, 0.0, 0.0, 1.0, 1.0, 2.0)
    return Difference("camera", tuple(sorted(rivals, key=lambda rival: -rival.p)), (seen,), 2.0)


@given(st.sampled_from(sorted(SENSES)), st.floats(0.0, 1.0), st.sampled_from((None, Level.PLAN, Level.GOAL)))
def test_it_doubts_once_and_ends_only_where_no_doubt_is_left(
    kind: RivalKind, p: float, open_at: Level | None
) -> None:
    bench = Bench()
    if open_at is not None:
        bench.doubt(open_at)
    found = bench.put(differ(kind, p))
    acts = p >= SURE and kind in WRONG and (kind in MISLEADING or p >= 1.0 - RISK)
    effects = bench.ask(sense_judge, found) if acts else ()
    ends, doubts = made(effects, Impasse), made(effects, Discrepancy)
    assert bool(ends) == (acts and p >= 1.0 - RISK)
    assert bool(doubts) == (acts and p < 1.0 - RISK and open_at is None)
    for effect in effects or ():
        assert reasons(effect) == {found.id}
    for end in ends:
        assert end.kind == "failed" and end.reason.startswith(f"{WRONG[kind]}: it is so")
    for doubt in doubts:
        assert (doubt.level, doubt.magnitude) == (Level.PLAN, None)  # looked at again before anything moves


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench()
    check_source(sense_judge, bench, bench.put(differ("lens", 1.0)))
