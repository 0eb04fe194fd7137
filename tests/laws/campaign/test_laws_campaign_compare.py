"""Laws of comparing campaigns: the p value by brute force, the interval by exact coverage, and symmetry."""

from __future__ import annotations

import math
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from harvey.campaign.show import CONFIDENCE, Comparison, compare, parse_success, rate_interval
from harvey.errors import BadInput

PAIRS = st.dictionaries(st.integers(0, 99), st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=40)


def reached(result: object) -> bool:
    assert isinstance(result, dict)
    return result["outcome"] == "reached"


def compared(pairs: dict[int, tuple[bool, bool]]) -> Comparison:
    first, second = ({case: {"outcome": "reached" if pair[side] else "lost"} for case, pair in pairs.items()}
                     for side in (0, 1))
    return compare(first, {**second, 1000: {"outcome": "reached"}}, reached)


@given(PAIRS)
def test_each_case_that_both_have_counts_once(pairs: dict[int, tuple[bool, bool]]) -> None:
    found = compared(pairs)
    assert found.cases == len(pairs)
    assert found.lost == tuple(sorted(case for case, pair in pairs.items() if pair == (True, False)))
    assert found.difference == pytest.approx(sum(b - a for a, b in pairs.values()) / len(pairs))
    low, high = found.interval
    assert -1.0 <= low <= found.difference <= high <= 1.0
    assert low < high


@given(PAIRS)
def test_the_p_value_is_that_of_all_ways_to_toss_a_coin(pairs: dict[int, tuple[bool, bool]]) -> None:
    found = compared(pairs)
    k, n = len(found.gained), found.discordant
    ways = [math.comb(n, m) for m in range(n + 1)]
    assert found.p_value == pytest.approx(sum(w for w in ways if w <= ways[k]) / 2**n)


@given(PAIRS)
def test_the_other_way_round_it_is_the_other_sign(pairs: dict[int, tuple[bool, bool]]) -> None:
    one, two = compared(pairs), compared({case: (b, a) for case, (a, b) in pairs.items()})
    assert two.difference == pytest.approx(-one.difference)
    assert two.interval == pytest.approx((-one.interval[1], -one.interval[0]))
    assert (one.is_better, one.is_worse, one.p_value) == (two.is_worse, two.is_better, pytest.approx(two.p_value))


@pytest.mark.parametrize("gain", [0.0, 0.02, 0.1, 0.3])
@pytest.mark.parametrize("loss", [0.0, 0.05, 0.3])
def test_the_interval_holds_as_often_as_it_says(gain: float, loss: float) -> None:
    """By the probability of every outcome of 12 pairs; and of alike campaigns few are told apart."""
    n, held, told_apart = 12, 0.0, 0.0
    for gained, lost in product(range(n + 1), repeat=2):
        same = n - gained - lost
        if same < 0:
            continue
        chance = (math.comb(n, gained) * math.comb(n - gained, lost)
                  * gain**gained * loss**lost * (1.0 - gain - loss) ** same)
        found = Comparison(same, 0, tuple(range(lost)), tuple(range(gained)))
        low, high = found.interval
        held += chance * (low <= gain - loss <= high)
        told_apart += chance * (found.is_better or found.is_worse)
    assert held >= CONFIDENCE
    if gain == loss:
        assert told_apart <= 1.0 - CONFIDENCE


def test_campaigns_without_a_case_in_common_are_refused() -> None:
    with pytest.raises(BadInput, match="cases in common"):
        compare({1: {}}, {2: {}}, reached)


@pytest.mark.parametrize(("text", "good", "bad"), [
    ("outcome=reached", "reached", "lost"), ("outcome<3", 2.5, 3), ("outcome<=3", 3, 3.5), ("outcome>3", 4, None),
    ("outcome=0", 0, 1), ("outcome = true", True, False)])
def test_what_counts_as_success_is_read(text: str, good: object, bad: object) -> None:
    succeeds = parse_success(text)
    assert succeeds({"outcome": good})
    assert not succeeds({"outcome": bad})
    with pytest.raises(BadInput, match="expected a field"):
        succeeds({"other": 1})


@pytest.mark.parametrize("text", ["outcome", "=reached", "outcome=", "outcome<many", ""])
def test_what_cannot_be_read_is_refused(text: str) -> None:
    with pytest.raises(BadInput, match="--success"):
        parse_success(text)


def test_a_rate_of_none_is_bounded() -> None:
    assert rate_interval(0, 1000) == pytest.approx((0.0, 1.0 - 0.025 ** (1 / 1000)))
