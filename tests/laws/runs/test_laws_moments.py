"""The telling moments of a recording: never the same twice, none that did not happen, every kind before any again."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from docs.tools.contact_sheet import LETTERS, caption
from docs.tools.moments import APART, KINDS, Moment, _drives, choose

moments = st.builds(Moment, st.integers(1, 60), st.sampled_from((*KINDS, "something new")), st.text(max_size=200))


@given(candidates=st.lists(moments, max_size=30), most=st.integers(0, 12))
def test_they_are_apart_in_order_and_happened(candidates: list[Moment], most: int) -> None:
    found = choose(candidates, most)
    assert len(found) <= most and set(found) <= set(candidates)
    assert all(later.cycle - earlier.cycle >= APART for earlier, later in pairwise(found))
    if len(found) < most:  # whatever is left out lies too near to one that is there
        assert all(any(abs(m.cycle - other.cycle) < APART for other in found) for m in candidates)


@given(kinds=st.lists(st.sampled_from(KINDS), min_size=1, max_size=40))
def test_every_kind_is_there_before_any_comes_again(kinds: list[str]) -> None:
    told = [Moment(3 * number, kind, "") for number, kind in enumerate(kinds)]
    distinct = len(set(kinds))
    assert {m.kind for m in choose(told, distinct)} == set(kinds)


def test_a_drive_is_looked_at_in_its_middle() -> None:
    activities = [(1, "plans"), (10, "drives"), (20, "looks"), (30, "drives")]
    assert [m.cycle for m in _drives(activities)] == [15]


@given(moment=moments)
def test_a_caption_is_one_line_that_fits(moment: Moment) -> None:
    text = caption(moment)
    assert len(text) <= LETTERS and "\n" not in text and text.startswith(f"cycle {moment.cycle} ")
