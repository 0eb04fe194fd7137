"""Laws of the mission monitor: one outcome a mission, by what weighs most: reached, no way on, lost, nothing left."""

from __future__ import annotations

import pytest

from blackboard import Entry, Level, Quiescence
from generated_boards import Bench, all_reasons, made
from harvey.testing import HALL, check_source, plain_robot
from knowledge_sources.goal.mission_monitor import mission_monitor
from world_models.entries import Alias, AliasOdds, Hypothesis, Impasse, Obstruction, Outcome, diagonal
from world_models.frames import Pose2

SOURCE = mission_monitor


def end(bench: Bench, trigger: Entry[object]) -> tuple[str, str, set[str]] | None:
    """Kind, reason, and what is named."""
    effects = bench.ask(SOURCE, trigger)
    if effects is None:
        return None
    (outcome,) = made(effects, Outcome)
    return outcome.kind, outcome.reason, all_reasons(effects)


def be_still(bench: Bench) -> Entry[Quiescence]:
    return bench.put(Quiescence(bench.cycle))


@pytest.mark.parametrize("is_reached", [True, False])
@pytest.mark.parametrize("has_impasse", [True, False])
@pytest.mark.parametrize("is_lost", [True, False])
def test_what_weighs_most_tells_how_it_ends(is_reached: bool, has_impasse: bool, is_lost: bool) -> None:
    bench = Bench(plain_robot())
    goal = bench.pursue()
    if is_reached:
        goal = bench.revise(goal, status="reached")
    impasse = bench.put(Impasse("blocked", "a wall", is_open=has_impasse))
    doubt = bench.doubt(Level.GOAL if is_lost else Level.PLAN)
    still = be_still(bench)
    found = end(bench, still)
    assert found is not None
    kind, reason, named = found
    if is_reached:
        assert (kind, named) == ("reached", {goal.id})
    elif has_impasse:
        assert (kind, reason, named) == ("blocked", "a wall", {impasse.id})
    elif is_lost:
        assert (kind, named) == ("lost", {still.id, doubt.id}) and "nobody could tell where" in reason
    else:
        assert (kind, named) == ("failed", {still.id, goal.id})
    bench.put(Outcome(kind, reason))
    assert end(bench, still) is None


@pytest.mark.parametrize("probability", [0.95, 0.985, 0.9989, 0.9991, 1.0])
@pytest.mark.parametrize("twins", [0, 1, 5])
def test_where_it_may_be_elsewhere_reached_says_so(probability: float, twins: int) -> None:
    """The probability and the likeliest of the other places; where none looks the same, or none is likely, nothing."""
    bench = Bench(plain_robot())
    goal = bench.revise(bench.pursue(), status="reached")
    others = tuple(Alias(f"room-{k}", Pose2(3.0 * k, 0.0, 0.0), -float(k)) for k in range(1, twins + 1))
    odds = bench.put(AliasOdds(0.98, probability, others, ("Certificate-1",), Pose2(0.0, 0.0, 0.0)))
    found = end(bench, goal)
    assert found is not None and found[0] == "reached"
    says = twins > 0 and probability < 0.999
    assert found[2] == {goal.id, *([odds.id] if says else [])}
    assert (f"{probability:.1%}" in found[1] and "room-1" in found[1]) == says


@pytest.mark.parametrize("kind", ["blocked", "lost", "failed", "stopped"])
def test_an_impasse_says_how_it_ends(kind: str) -> None:
    bench = Bench(plain_robot())
    impasse = bench.put(Impasse(kind, f"why {kind}"))
    assert end(bench, impasse) == (kind, f"why {kind}", {impasse.id})


@pytest.mark.parametrize(("weights", "said"), [
    ((), "nobody could tell where"), ((0.7,), "perhaps"), ((0.6, 0.4), "ambiguous where")])
def test_lost_it_says_where_it_may_be(weights: tuple[float, ...], said: str) -> None:
    bench = Bench(plain_robot())
    bench.believe()
    doubt = bench.doubt()
    perhaps = [bench.put(Hypothesis(HALL, Pose2(1.0 + k, 2.0, 0.0), diagonal(0.1, 0.1), "relocalization",
                                    status="candidate", weight=w)) for k, w in enumerate(weights)]
    still = be_still(bench)
    found = end(bench, still)
    assert found is not None and found[0] == "lost" and said in found[1]
    assert found[2] == {still.id, doubt.id, *(p.id for p in perhaps)}
    for k, weight in enumerate(weights):
        assert f"({1.0 + k:.2f}, 2.00) m) ({weight:.0%})" in found[1]


def test_it_names_the_milestone_for_which_nobody_answered() -> None:
    bench = Bench(plain_robot())
    goal, milestone = bench.pursue(), bench.await_milestone()
    still = be_still(bench)
    found = end(bench, still)
    assert found is not None and found[0] == "failed" and milestone.id in found[1]
    assert found[2] == {still.id, milestone.id, goal.id}
    bench.revise(milestone, status="verified")
    found = end(bench, still)
    assert found is not None and found[2] == {still.id, goal.id}


@pytest.mark.parametrize("is_reached", [True, False])
@pytest.mark.parametrize("clockwise", [True, False])
def test_what_hides_a_part_of_the_pictures_is_said_where_the_goal_is_not_reached(
    is_reached: bool, clockwise: bool
) -> None:
    bench = Bench(plain_robot())
    goal = bench.pursue()
    impasse = bench.put(Impasse("blocked", "a wall"))
    if is_reached:
        goal = bench.revise(goal, status="reached")
    corners = ((0.0, 0.0), (128.0, 0.0), (128.0, 64.0), (0.0, 64.0))  # of 256 x 256
    hidden = bench.put(Obstruction(corners[::-1] if clockwise else corners))
    found = end(bench, goal if is_reached else impasse)
    assert found is not None
    assert (hidden.id in found[2]) is not is_reached
    assert found[1].endswith("hides 12% of each picture") is not is_reached


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench(plain_robot())
    check_source(SOURCE, bench, bench.revise(bench.pursue(), status="reached"))
