"""The law of bad lines: nothing that was not asked for, nothing twice, no hang, and it stands in time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.robustness.serial.findings import PROTOCOLS, Findings
from experiments.robustness.serial.trial import Trial
from experiments.robustness.serial_chaos import NOISES


@pytest.mark.parametrize("protocol", PROTOCOLS)
@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), noise=st.sampled_from(NOISES), breaks=st.sampled_from((0.0, 0.5, 1.0)))
def test_motions_over_a_bad_line_are_those_that_were_asked_for(
    protocol: str, seed: int, noise: float, breaks: float
) -> None:
    found = Findings()
    Trial(protocol, np.random.default_rng(seed), found, noise).run(3, breaks)
    assert found.violations == []
    assert found.late == 0
    assert found.resumed == found.ended == 1


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_over_a_good_line_every_motion_is_done(protocol: str) -> None:
    found = Findings()
    Trial(protocol, np.random.default_rng(7), found, 0.0).run(5, 0.0)
    assert found.done == found.asked == 6
    assert not found.faults and not found.strays
