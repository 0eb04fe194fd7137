"""One cycle of the scheduler: its order, who acts, what is refused, and what everyone is told."""

from __future__ import annotations

from collections.abc import Iterable
from enum import Enum
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import (
    RAISED,
    Change,
    Condition,
    Effect,
    Entry,
    Ladder,
    Level,
    Post,
    Posted,
    Retract,
    Retracted,
    Revise,
    Revised,
    Scheduler,
    View,
    decision_line,
)
from strategies import Note, Scripted, Tally, levels, ratings, run
from world_models.entries import LADDER, Discrepancy


class Port:
    """Answers every tally with a note, and tells ``heard`` what it was told."""

    name = "port"

    def __init__(self, heard: list[Any]) -> None:
        self.heard = heard

    def answer(self, change: Change) -> Iterable[Effect]:
        self.heard.append(("port", change.entry.id))
        if isinstance(change.entry.value, Tally):
            yield Post(Note("observed"), (change.entry,))


def post(scheduler: Scheduler, *values: Any) -> list[Entry[Any]]:
    return [change.entry for change in scheduler.post([Post(value) for value in values], "user")]


def names(activations: Iterable[Any]) -> list[str]:
    return [a.source.name for a in activations]


def post_tally(_view: View, trigger: Change) -> Iterable[Effect]:
    yield Post(Tally(1), (trigger.entry,))


def test_a_cycle_goes_in_order() -> None:
    heard: list[Any] = []

    def said(word: str, answer: Any) -> Any:
        heard.append(word)
        return answer

    pending = Scripted("pending", rate=0.1)
    source = Scripted(
        "source", Tally, lambda v, t: said("act", [Post(Tally(2), (t.entry,))]), rate=lambda v, t: said("rate", 0.9),
        where=lambda tally: tally.count == 1,
    )
    scheduler = Scheduler([pending, source], ports=[Port(heard)], sinks=[lambda d: heard.append("sink")])
    post(scheduler, Note("a"), Note("b"))
    scheduler.step()
    heard.clear()
    post(scheduler, Tally(1))
    decision = scheduler.step()
    assert decision.chosen.source is source
    assert heard == ["rate", "act", "sink", ("port", "Tally-2")]


class Urgency(float, Enum):
    HIGH = 0.9


def test_a_rating_is_a_plain_number_whatever_scale_it_is_named_on() -> None:
    scheduler = Scheduler([Scripted("first", Note, post_tally, rate=lambda _v, _t: Urgency.HIGH)])
    post(scheduler, Note("a"))
    decision = scheduler.step()
    assert type(decision.chosen.rating) is float and f"{decision.chosen.rating:.1f}" == "0.9"


def test_changes_made_now_wait_a_cycle() -> None:
    scheduler = Scheduler([Scripted("first", Note, post_tally), Scripted("second", Tally, rate=1.0)])
    (note,) = post(scheduler, Note("a"))
    first, second = run(scheduler)
    assert [c.entry for c in first.seen] == [note] and names(first.activated) == ["first"]
    assert second.seen == first.made and names(second.activated) == ["second"]
    assert scheduler.step() is None


def test_what_a_port_observes_is_seen_in_the_next_cycle() -> None:
    heard: list[Any] = []
    scheduler = Scheduler([Scripted("first", Note, post_tally, where=lambda n: n.text == "a")], ports=[Port(heard)])
    post(scheduler, Note("a"))
    first, second = run(scheduler)
    assert [c.entry.value for c in first.observed] == [Note("a")]
    assert [c.entry.value for c in second.seen] == [Tally(1), Note("observed")]
    (observed,) = second.observed
    assert observed.entry.author == "port" and observed.entry.because == (first.made[0].entry.ref,)


def test_the_journal_has_the_decision_before_any_port_sees_it() -> None:
    heard: list[Any] = []
    scheduler = Scheduler(
        [Scripted("first", Note, post_tally, where=lambda n: n.text == "a")], ports=[Port(heard)],
        sinks=[lambda d: heard.append(("one", d.cycle)), lambda d: heard.append(("two", d.cycle))],
    )
    post(scheduler, Note("a"))
    scheduler.step()
    assert heard == [("one", 1), ("two", 1), ("port", "Tally-1")]


def test_a_revision_obviates_what_the_entry_before_it_triggered() -> None:
    patient = Scripted("patient", Note, rate=0.1)

    def rewrite(view: View, trigger: Change) -> Iterable[Effect]:
        yield Revise(trigger.entry, Note("b"))

    scheduler = Scheduler([patient, Scripted("editor", Note, rewrite, where=lambda n: n.text == "a")])
    post(scheduler, Note("a"), Note("other"))
    first, second, third, *rest = run(scheduler)
    assert names(first.activated) == ["patient", "editor", "patient"] and first.pending == 2
    (dropped,) = second.obviated
    assert dropped.activation is first.activated[0] and dropped.reason == "stale trigger: Note-1.0 is now Note-1.1"
    assert [d.chosen.trigger.entry.ref for d in (second, third)] == [("Note-2", 0), ("Note-1", 1)] and rest == []


@pytest.mark.parametrize(
    ("effect", "now"), [(lambda e: Revise(e, Note("b")), "now Note-1.1"), (Retract, "retracted")]
)
def test_an_activation_whose_entry_changed_is_obviated(effect: Any, now: str) -> None:
    eager = Scripted("eager", Note, lambda v, t: [effect(t.entry)], rate=0.9, kinds=(Posted,))
    scheduler = Scheduler([Scripted("late", Note, post_tally, rate=0.1, kinds=(Posted,)), eager])
    post(scheduler, Note("a"))
    first, second = run(scheduler)
    assert names(first.activated) == ["late", "eager"] and first.chosen.source is eager
    assert [(o.activation.source.name, o.reason) for o in second.obviated] == [
        ("late", f"stale trigger: Note-1.0 is {now}")
    ]
    assert second.chosen is None and not scheduler.view.all(Tally)


def test_an_activation_that_could_no_longer_answer_is_obviated() -> None:
    shy = Scripted("shy", Note, rate=lambda view, t: None if view.all(Tally) else 0.1)
    scheduler = Scheduler([shy, Scripted("eager", Note, post_tally, rate=0.9)])
    post(scheduler, Note("a"))
    _, second = run(scheduler)
    assert [(o.activation.source.name, o.reason) for o in second.obviated] == [("shy", "could not answer any more")]


def test_a_retraction_triggers_its_watchers() -> None:
    mourner = Scripted("mourner", Note, post_tally, kinds=(Retracted,))
    scheduler = Scheduler([mourner])
    (note,) = post(scheduler, Note("a"))
    scheduler.post([Retract(note)], "user")
    assert names([run(scheduler)[0].chosen]) == ["mourner"]


@settings(deadline=None, max_examples=60)
@given(bids=st.lists(st.tuples(ratings, levels), min_size=1, max_size=6))
def test_the_nearest_level_then_the_best_rated_then_the_oldest_acts(bids: list[tuple[float, Level]]) -> None:
    order = sorted(range(len(bids)), key=lambda i: (bids[i][1], -bids[i][0], i))
    scheduler = Scheduler([Scripted(f"e{i}", rate=rating, level=level) for i, (rating, level) in enumerate(bids)])
    post(scheduler, Note("a"))
    decisions = run(scheduler)
    assert names(d.chosen for d in decisions) == [f"e{i}" for i in order]
    assert [d.runner_up and d.runner_up.source.name for d in decisions] == [*(f"e{i}" for i in order[1:]), None]
    assert [a.number for a in decisions[0].activated] == list(range(1, len(bids) + 1))


def test_an_act_sees_the_board_as_it_was_before_it() -> None:
    def look_twice(view: View, trigger: Change) -> Iterable[Effect]:
        yield Post(Tally(len(view)))
        yield Post(Tally(len(view)))

    scheduler = Scheduler([Scripted(act=look_twice)])
    post(scheduler, Note("a"))
    run(scheduler)
    assert [e.value.count for e in scheduler.view.all(Tally)] == [1, 1]


def raise_late(_view: View, _trigger: Change) -> Iterable[Effect]:
    yield Post(Tally(1))
    raise KeyError("no such landmark")


def rest_on_nothing(_view: View, _trigger: Change) -> Iterable[Effect]:
    yield Post(Tally(1))
    yield Post(Tally(2), ("nothing",))


def change_type(_view: View, trigger: Change) -> Iterable[Effect]:
    yield Post(Tally(1))
    yield Revise(trigger.entry, Tally(2))


def yield_no_effect(_view: View, _trigger: Change) -> Iterable[Any]:
    yield Post(Tally(1))
    yield Tally(2)


@pytest.mark.parametrize(
    ("act", "named"),
    [(raise_late, "no such landmark"), (rest_on_nothing, "'nothing'"), (change_type, "to stay a Note"),
     (yield_no_effect, "Tally")],
)
def test_a_source_that_raises_is_journalled_and_nothing_is_applied(act: Any, named: str) -> None:
    lines: list[str] = []
    bad = Scripted("bad", act=act, rate=0.9)
    scheduler = Scheduler([bad, Scripted("good", act=post_tally)], sinks=[lambda d: lines.append(decision_line(d))])
    post(scheduler, Note("a"))
    first, second, *_ = run(scheduler)
    assert first.chosen.source is bad and first.made == ()
    assert first.refused.startswith(RAISED) and "Traceback" in first.refused and named in first.refused
    assert RAISED in lines[0] and len(lines) >= 2
    assert names([second.chosen]) == ["good"] and len(scheduler.view.all(Tally)) == 1


def fail(*_args: Any) -> Any:
    raise KeyError("no such landmark")


@pytest.mark.parametrize(
    "bad",
    [Scripted("bad", rate=fail), Scripted("bad", where=fail), Scripted("bad", rate=1.5),
     Scripted("bad", rate=float("nan"))],
)
def test_a_source_that_raises_when_it_is_asked_is_journalled_and_nobody_acts(bad: Scripted) -> None:
    scheduler = Scheduler([Scripted("good", act=post_tally), bad])
    post(scheduler, Note("a"))
    first = scheduler.step()
    assert first.refused.startswith(RAISED) and "Traceback" in first.refused
    assert first.chosen is None and first.runner_up is None and first.made == ()
    assert names([scheduler.step().chosen]) == ["good"]


def test_effects_of_a_kind_not_its_own_are_refused() -> None:
    def meddle(_view: View, trigger: Change) -> Iterable[Effect]:
        yield Post(Tally(1))
        yield Retract(trigger.entry)

    scheduler = Scheduler([Scripted("meddler", act=meddle, writes=(Tally,))])
    (note,) = post(scheduler, Note("a"))
    (decision,) = run(scheduler)
    assert decision.refused == "meddler may not write Note" and decision.made == ()
    assert scheduler.view.is_current(note) and len(scheduler.view) == 1


def test_a_stale_act_is_refused() -> None:
    old = Entry("Note-1", 0, Note("a"), "user", 0)
    slow = Scripted("slow", Tally, lambda v, t: [Post(Tally(2)), Revise(old, Note("c"))], kinds=(Posted,))
    scheduler = Scheduler([slow])
    (entry,) = post(scheduler, Note("a"))
    scheduler.post([Revise(entry, Note("b")), Post(Tally(1))], "user")
    decision = run(scheduler)[0]
    assert decision.refused == "stale: Note-1.0 is now Note-1.1" and decision.made == ()
    assert len(scheduler.view) == 2


def test_two_experts_of_one_name_are_refused() -> None:
    with pytest.raises(ValueError, match="different names"):
        Scheduler([Scripted("same"), Scripted("same")])


def test_a_level_that_is_off_silences_the_experts_that_close_it() -> None:
    sources = [Scripted("closer", closes=Level.ACTION), Scripted("worker", level=Level.ACTION)]
    scheduler = Scheduler(sources, ladder=Ladder(Level, off=frozenset({Level.ACTION})))
    post(scheduler, Note("a"))
    assert names(scheduler.step().activated) == ["worker"]


def test_without_news_and_work_there_is_no_cycle() -> None:
    scheduler = Scheduler([Scripted()])
    assert scheduler.step() is None and scheduler.cycle == 0


rules = st.lists(
    st.tuples(st.sampled_from((Note, Tally)), st.sampled_from(("post", "revise", "retract", "raise")), ratings, levels),
    min_size=1, max_size=5,
)


def source_of(number: int, rule: tuple[type[Any], str, float, Level]) -> Scripted:
    on, what, rating, level = rule

    def act(view: View, trigger: Change) -> Iterable[Effect]:
        others = view.all(Note if on is Tally else Tally)
        yield Post(Tally(len(view)), (trigger.entry,))
        if what == "revise":
            yield Revise(trigger.entry, trigger.entry.value, others)
        elif what == "retract" and others:
            yield Retract(others[0])
        elif what == "raise":
            raise ArithmeticError(f"{len(view)}")

    return Scripted(f"e{number}", on, act, rate=rating, level=level, kinds=(Posted, Revised, Retracted))


def journal_of(program: list[Any], focus: Level) -> list[str]:
    lines: list[str] = []
    scheduler = Scheduler(
        [source_of(i, rule) for i, rule in enumerate(program)], ports=[Port([])],
        sinks=[lambda d: lines.append(decision_line(d))], ladder=LADDER, kinds=[Discrepancy],
    )
    post(scheduler, Note("a"), Discrepancy(focus, "it is elsewhere", 1.0, (2.0, 3.0), "px"))
    run(scheduler, 20)
    return lines


@settings(deadline=None, max_examples=40)
@given(program=rules, focus=levels)
def test_equal_runs_give_equal_journals(program: list[Any], focus: Level) -> None:
    lines = journal_of(program, focus)
    assert lines and lines == journal_of(program, focus)


@settings(deadline=None, max_examples=40)
@given(program=rules, focus=levels)
def test_every_change_is_seen_exactly_once_in_the_cycle_after_it(program: list[Any], focus: Level) -> None:
    scheduler = Scheduler([source_of(i, rule) for i, rule in enumerate(program)])
    post(scheduler, Note("a"))
    decisions = run(scheduler, 20)
    for one, two in pairwise(decisions):
        assert two.seen == one.made
        assert all(c.entry.cycle == one.cycle for c in one.made if not isinstance(c, Retracted))


def test_a_source_is_asked_only_where_all_that_it_needs_is_so() -> None:
    """And the first need that is not met is what it says of itself."""
    asked: list[Any] = []
    source = Scripted("needy", Note, lambda v, t: [Post(Tally(9))], rate=lambda v, t: asked.append(t) or 0.5)
    tally: Condition[Entry[Tally]] = Condition("a tally", lambda view: view.latest(Tally), "none was counted")
    few = Condition("few tallies", lambda view: len(view.all(Tally)) < 3, lambda view: f"{len(view.all(Tally))} were")
    source.needs = (tally, few)
    scheduler = Scheduler([source])
    for met, told in ((False, "none was counted"), (True, ""), (True, ""), (False, "3 were")):
        asked.clear()
        unmet = source.find_unmet(scheduler.view)
        assert told == ("" if unmet is None else unmet.tell_otherwise(scheduler.view))
        post(scheduler, Note("a"))
        decision = scheduler.step()
        assert bool(asked) == bool(decision.chosen) == met
        if not met and not scheduler.view.all(Tally):
            with pytest.raises(LookupError, match="a tally, but none was counted"):
                tally.of(scheduler.view)
            post(scheduler, Tally(1))
            scheduler.step()
        elif met:
            assert tally.of(scheduler.view).value == Tally(9)
            run(scheduler)


@given(st.lists(st.integers(0, 2), max_size=8))
def test_what_comes_from_outside_is_of_the_cycle_that_is_over_and_is_seen_in_the_next(posts: list[int]) -> None:
    scheduler = Scheduler([Scripted()])
    for count in posts:
        posted = [scheduler.post([Post(Note("so it is"))], "user")[0] for _ in range(count)]
        assert {change.entry.cycle for change in posted} <= {scheduler.cycle}
        decision = scheduler.step()
        if decision is not None and posted:
            assert list(decision.observed) == posted
            assert {change.entry.cycle for change in posted} == {decision.cycle - 1}
