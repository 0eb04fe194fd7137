"""The law of bad lines: nothing that was not asked for, nothing twice, no hang, and it stands in time."""

from __future__ import annotations

import pytest

from tests.serial_bench import (
    check_motions_over_a_bad_line_are_those_that_were_asked_for,
    check_over_a_good_line_every_motion_is_done,
)


@pytest.mark.parametrize("protocol", ["denning"])
def test_motions_over_a_bad_line_are_those_that_were_asked_for(protocol: str) -> None:
    check_motions_over_a_bad_line_are_those_that_were_asked_for(protocol)


@pytest.mark.parametrize("protocol", ["denning"])
def test_over_a_good_line_every_motion_is_done(protocol: str) -> None:
    check_over_a_good_line_every_motion_is_done(protocol)
