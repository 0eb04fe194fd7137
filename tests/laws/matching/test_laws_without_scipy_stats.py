"""What stands in for parts of scipy.stats, whose import every mission would wait for, gives the same bits."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, norm, qmc

from knowledge_sources.methods.matching.pose_matching import _spread_normal
from knowledge_sources.methods.verification import compute_p_false
from knowledge_sources.methods.verification.line_check import TEST_COUNT


@given(st.integers(1, 3000))
def test_spread_is_haltons_sequence_of_the_normal_law(count: int) -> None:
    expected = norm.ppf(qmc.Halton(6, scramble=False).random(count + 1)[1:])
    spread = _spread_normal(count)
    assert not spread[0].any()
    assert np.array_equal(spread[1:], expected)


@given(st.data(), st.integers(1, 200), st.floats(0.01, 0.99))
def test_chance_of_so_many_matches_is_the_binomial_tail(data: st.DataObject, visible: int, chance: float) -> None:
    matched = data.draw(st.integers(0, visible))
    tail = float(binom.sf(matched - 1, visible, chance))
    assert compute_p_false(matched, visible, chance) == min(1.0, TEST_COUNT * tail)
