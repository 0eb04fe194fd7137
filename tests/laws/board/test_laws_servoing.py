"""The three servo levels (§2, Figure 2) without robot or image: what may climb, and what is worked on meanwhile."""

from __future__ import annotations

import math
from collections.abc import Iterable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from blackboard import Change, Decision, Effect, Level, Post, Posted, Ref, Retracted, Revise, Scheduler, View
from knowledge_sources.goal.discrepancy_raiser import discrepancy_raiser
from strategies import Note, Scripted, levels, magnitudes, run
from world_models.entries import LADDER, Discrepancy

bounds = st.tuples(st.floats(0.0, 5.0), st.floats(0.0, 8.0))


@given(level=levels, magnitude=magnitudes | st.none(), both=bounds)
def test_only_what_exceeds_its_stated_bound_climbs_and_only_one_level(
    level: Level, magnitude: float | None, both: tuple[float, float]
) -> None:
    found = Discrepancy(level, "it is elsewhere", magnitude, both, "px")
    if magnitude is None or level is Level.GOAL or magnitude <= both[level]:
        assert not found.exceeds
        with pytest.raises(ValueError, match="expected more than the bound"):
            found.escalated()
        return
    closed, raised = found.escalated()
    assert closed.status == "escalated" and not closed.is_open and closed.magnitude == magnitude > closed.bound
    assert raised.level == level + 1 and raised.is_open and raised.magnitude is None and not raised.exceeds
    assert (raised.what, raised.bounds, raised.unit) == (found.what, both, "px")


@given(level=levels, magnitude=magnitudes, both=bounds)
def test_what_is_corrected_is_closed_for_good(level: Level, magnitude: float, both: tuple[float, float]) -> None:
    corrected = Discrepancy(level, "it is elsewhere", magnitude, both, "px").corrected()
    assert not corrected.is_open and not corrected.exceeds and corrected.magnitude == magnitude


@pytest.mark.parametrize("magnitude", [math.nan, -0.1])
def test_a_magnitude_that_says_nothing_is_refused(magnitude: float) -> None:
    with pytest.raises(ValueError, match="expected a magnitude of at least 0 px"):
        Discrepancy(Level.ACTION, "it is elsewhere", magnitude, (1.0, 2.0), "px")


def test_there_is_nothing_above_the_goal() -> None:
    assert [level.above for level in (Level.ACTION, Level.PLAN)] == [Level.PLAN, Level.GOAL]
    with pytest.raises(ValueError, match="3"):
        _ = Level.GOAL.above


def correct(_view: View, trigger: Change) -> Iterable[Effect]:
    yield Revise(trigger.entry, trigger.entry.value.corrected(), (trigger.entry,))


def measure(_view: View, trigger: Change) -> Iterable[Effect]:
    """What a level measures is written in the discrepancy's words: ``plan 2.5``."""
    value: Discrepancy = trigger.entry.value
    yield Revise(trigger.entry, Discrepancy(value.level, value.what, float(value.what), value.bounds, value.unit))


def corrector(level: Level) -> Scripted:
    return Scripted(
        f"{level}_corrector", Discrepancy, correct, level=level, writes=(Discrepancy,),
        where=lambda d: d.is_open and d.level is level and d.magnitude is not None and not d.exceeds,
    )


def measurer(level: Level) -> Scripted:
    return Scripted(
        f"{level}_measurer", Discrepancy, measure, level=level, writes=(Discrepancy,),
        where=lambda d: d.is_open and d.level is level and d.magnitude is None,
    )


def worker(level: Level) -> Scripted:
    return Scripted(f"{level}_worker", Note, level=level, where=lambda note: note.text == str(level))


class ServoMachine(RuleBasedStateMachine):
    """Discrepancies of any size arise at the action and the plan level, while work is to be done at all three."""

    def __init__(self) -> None:
        super().__init__()
        self.decisions: list[Decision] = []
        self.found: dict[Ref, Discrepancy] = {}
        self.scheduler = Scheduler(
            [*map(worker, Level), *map(corrector, Level), *map(measurer, (Level.PLAN, Level.GOAL)),
             discrepancy_raiser],
            sinks=[self.decisions.append], ladder=LADDER,
        )

    @rule(level=st.sampled_from((Level.ACTION, Level.PLAN)), first=magnitudes, then=magnitudes, both=bounds)
    def deviate(self, level: Level, first: float, then: float, both: tuple[float, float]) -> None:
        self.scheduler.post([Post(Discrepancy(level, str(then), first, both, "px"))], "user")

    @rule(level=levels)
    def give_work(self, level: Level) -> None:
        self.scheduler.post([Post(Note(str(level)))], "user")

    @rule()
    def go_on(self) -> None:
        pending = self.open_levels()
        decision = self.scheduler.step()
        if decision is None:
            return
        assert decision.refused == ""
        assert decision.focus == max(pending, default=Level.ACTION)
        self.nearest_level_acts(decision)
        self.escalations_are_lawful(decision)

    def open_levels(self) -> list[Level]:
        return [e.value.level for e in self.scheduler.view.all(Discrepancy) if e.value.is_open]

    def nearest_level_acts(self, decision: Decision) -> None:
        chosen, second = decision.chosen, decision.runner_up
        if chosen and second:
            distance = [abs(a.source.level - decision.focus) for a in (chosen, second)]
            assert distance[0] <= distance[1]

    def escalations_are_lawful(self, decision: Decision) -> None:
        """No level is skipped; every escalation exceeds the bound that it states, and rests on what it escalates."""
        for change in (*decision.observed, *decision.made):
            assert not isinstance(change, Retracted)
            self.found[change.entry.ref] = change.entry.value
        for change in decision.made:
            if change.entry.author == "discrepancy_raiser" and isinstance(change, Posted) and isinstance(
                change.entry.value, Discrepancy
            ):
                (reason,) = change.entry.because
                closed = self.found[reason]
                assert closed.status == "escalated" and closed.magnitude > closed.bound
                assert change.entry.value.level == closed.level + 1 and change.entry.value.magnitude is None

    @invariant()
    def nothing_that_its_level_may_correct_was_escalated(self) -> None:
        for entry in self.scheduler.view.all(Discrepancy):
            if entry.value.status == "escalated":
                assert entry.value.level is not Level.GOAL and entry.value.magnitude > entry.value.bound

    def teardown(self) -> None:
        """Success comes back down: whatever arose, in the end nothing is open and the action level is in focus."""
        run(self.scheduler, 400)
        assert self.open_levels() == []
        if self.decisions:
            self.scheduler.post([Post(Note("action"))], "user")
            last = self.scheduler.step()
            assert last.focus is Level.ACTION and last.chosen.source.name == "action_worker"


TestServoing = ServoMachine.TestCase
TestServoing.settings = settings(max_examples=50, stateful_step_count=25, deadline=None)


def test_action_work_goes_before_plan_work_while_only_action_discrepancies_are_open() -> None:
    plan = Scripted("planner", Note, level=Level.PLAN, rate=1.0)
    act = Scripted("driver", Discrepancy, correct, level=Level.ACTION, rate=0.1, writes=(Discrepancy,),
                 where=lambda d: d.is_open)
    scheduler = Scheduler([plan, act, discrepancy_raiser], ladder=LADDER)
    small = Discrepancy(Level.ACTION, "slightly off", 1.0, (2.0, 3.0), "px")
    scheduler.post([Post(Note("a")), Post(small)], "user")
    decisions = run(scheduler)
    assert [d.focus for d in decisions[:2]] == [Level.ACTION] * 2
    assert [d.chosen.source.name for d in decisions[:2]] == ["driver", "planner"]


def test_an_action_discrepancy_beyond_its_bound_brings_the_plan_level_into_focus_once_it_is_raised() -> None:
    scheduler = Scheduler([corrector(Level.PLAN), measurer(Level.PLAN), discrepancy_raiser], ladder=LADDER)
    scheduler.post([Post(Discrepancy(Level.ACTION, "2.5", 2.5, (2.0, 3.0), "px"))], "user")
    decisions = run(scheduler)
    assert [(str(d.focus), d.chosen and d.chosen.source.name) for d in decisions] == [
        ("action", "discrepancy_raiser"), ("plan", "plan_measurer"), ("plan", "plan_corrector"), ("action", None),
    ]
    assert [e.value.status for e in scheduler.view.all(Discrepancy)] == ["escalated", "corrected"]
