"""``check_source`` names each way in which a source breaks the laws of all sources, and passes one that keeps them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from itertools import count
from typing import Any

import pytest

from blackboard import Change, Condition, Effect, Post, Revised, View
from harvey.testing import Bench, add, check_source
from strategies import Note, Scripted, Tally

CALLS = count()
Act = Callable[[View, Change], Iterable[Effect]]


def add_up(view: View, trigger: Change) -> Iterable[Effect]:
    """The length of a note and all tallies; it names both."""
    tallies = view.all(Tally)
    length = len(trigger.entry.value.text) + sum(one.value.count for one in tallies)
    yield Post(Tally(length), (trigger.entry, *tallies))


def add_up_unnamed(view: View, trigger: Change) -> Iterable[Effect]:
    yield from (Post(effect.value, (trigger.entry,)) for effect in add_up(view, trigger) if isinstance(effect, Post))


def count_calls(_view: View, trigger: Change) -> Iterable[Effect]:
    yield Post(Tally(next(CALLS)), (trigger.entry,))


def write_on_the_board(view: View, trigger: Change) -> Iterable[Effect]:
    view._board.apply([Post(Tally(9))], author="nobody", cycle=9)
    yield Post(Tally(1), (trigger.entry,))


def board() -> tuple[Bench, Any]:
    bench = Bench()
    bench.put(Tally(3))
    return bench, bench.put(Note("abc"))


BROKEN: Mapping[str, tuple[Act, dict[str, Any], dict[str, Any]]] = {
    "does not watch": (add_up, {"kinds": (Revised,)}, {}),
    "has no case": (add_up, {"rate": lambda _view, _trigger: None}, {}),
    "is rated 1.5": (add_up, {"rate": 1.5}, {}),
    "writes what it does not declare": (add_up, {"writes": (Note,)}, {}),
    "without a reason": (lambda _view, _trigger: [Post(Tally(1))], {}, {}),
    "does not name Tally-1": (add_up_unnamed, {}, {}),
    "acts without Tally-1": (add_up, {}, {"without": ("Tally-1",)}),
    "decides otherwise": (count_calls, {}, {}),
    "changes the board|decides otherwise": (write_on_the_board, {}, {}),
    "on a board alike": (add_up, {}, {"alike": [(*board(), lambda value: replace(value, count=-value.count))]}),
}


@pytest.mark.parametrize("said", BROKEN)
def test_what_is_broken_is_named(said: str) -> None:
    act, how, asked = BROKEN[said]
    with pytest.raises(AssertionError, match=said):
        check_source(Scripted(act=act, **how), *board(), **asked)


def test_a_source_that_keeps_them_passes_with_a_condition_of_its_own() -> None:
    source = Scripted(act=add_up)
    (effect,) = check_source(source, *board(), alike=[(*board(), lambda value: value)])
    assert isinstance(effect, Post) and effect.value == Tally(6)
    source.needs = (Condition("no tally of nine", lambda view: not view.where(Tally, lambda t: t.count == 9), "so"),)
    with pytest.raises(AssertionError, match="say what breaks it"):
        check_source(source, *board())
    check_source(source, *board(), breaks={"no tally of nine": add(Tally(9))})
