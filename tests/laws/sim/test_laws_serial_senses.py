"""Laws of touch and range over the Denning-style line: what a base feels is what its driver tells."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from harvey.hardware.drivers import denning
from harvey.hardware.drivers.base_driver import BaseFault
from harvey.hardware.drivers.denning import DenningBase
from sim.emulators.denning_emulator import ConstantSpeedMotion, DenningEmulator, InstantMotion
from sim.emulators.emulator import IdealGround
from tests.serial_bench import put_on_noisy_line
from world_models.entries import Contact, MotionReport, MotorCommand, Ranges
from world_models.entries.obstacle import AHEAD_SIGMA_RAD

ANGLES = st.floats(-math.pi, math.pi)
WORDS = st.lists(st.text("0123456789.-e", min_size=1, max_size=7) | st.sampled_from(("bumper", "stall", "none")),
                 max_size=8).map(tuple)
CONTACTS = st.none() | st.builds(
    Contact, st.sampled_from(("bumper", "stall")), ANGLES, st.floats(0.001, 3.0), st.floats(0.0, 1e6))
DISTANCES = st.lists(st.none() | st.floats(0.0, 60.0), min_size=1, max_size=24)


class StubBody:
    """Stops half way of every move, and feels what it is told to."""

    speed_m_per_s = 0.6

    def __init__(self, contact: Contact | None, ranges: Ranges | None) -> None:
        self._contact, self._ranges = contact, ranges

    def execute(self, command: MotorCommand, /) -> MotionReport:
        return MotionReport(command.turn_rad, command.move_m / 2.0, 1.0, 2.0)

    def take_contact(self) -> Contact | None:
        return self._contact

    def ranges(self) -> Ranges | None:
        return self._ranges


class OldBase(DenningEmulator):
    """A base that was written before there were senses in the protocol."""

    asked = 0

    def _obey(self, token: str, seq: int, verb: str, words: list[str]) -> None:
        self.asked += verb in ("TOUCH", "RANGES")
        super()._obey(token, seq, "WHAT" if verb in ("TOUCH", "RANGES") else verb, words)


def ring(distances: list[float | None]) -> Ranges:
    axes = tuple(math.remainder(math.tau * at / len(distances), math.tau) for at in range(len(distances)))
    return Ranges(axes, tuple(distances), 0.02, 0.218, 99.0, 0.0)


def over_denning(body: StubBody) -> DenningBase:
    return DenningBase(put_on_noisy_line(DenningEmulator(InstantMotion(body))))


@settings(deadline=None, max_examples=40)
@given(CONTACTS)
def test_a_contact_comes_over_the_denning_line_as_it_was_felt(contact: Contact | None) -> None:
    base = over_denning(StubBody(contact, None))
    assert base.move(0.4).move_m == 0.2
    assert base.take_contact() == contact and base.take_contact() is None


@settings(deadline=None, max_examples=40)
@given(DISTANCES)
def test_ranges_come_over_the_denning_line_to_the_millimetre(distances: list[float | None]) -> None:
    found = over_denning(StubBody(None, ring(distances))).ranges()
    assert found is not None and found.directions_rad == ring(distances).directions_rad
    assert [d is None for d in found.distances_m] == [d is None for d in distances]
    for heard, told in zip(found.distances_m, distances, strict=True):
        assert heard is None or told is None or abs(heard - told) <= 0.000501
    assert (found.sigma_m, found.half_beam_rad, found.max_range_m) == (0.02, 0.218, 99.0)


def test_a_base_without_sensors_measures_nothing() -> None:
    assert over_denning(StubBody(None, None)).ranges() is None


@given(st.integers(0, 999_999_999), DISTANCES)
def test_the_longest_ring_fits_on_a_line(seq: int, distances: list[float | None]) -> None:
    words = ("999999999", "999", "999", "99999", *("-" if d is None else str(round(1000 * d)) for d in distances))
    frame = denning.Packet("FFFFFFFF", seq, "ECHOES", words)
    line = denning.encode(frame)
    assert len(line) <= denning.LONGEST and denning.decode(line.rstrip(b"\n")) == frame


@given(WORDS)
def test_what_is_no_contact_and_no_reading_is_none(words: tuple[str, ...]) -> None:
    contact = denning.parse_contact(denning.Packet("00000000", 1, "FELT", words))
    assert contact is None or contact.by == words[0]
    ranges = denning.parse_ranges(words, 1.0)
    assert ranges is None or len(ranges.distances_m) == len(words) - 3


def test_an_old_base_is_asked_once_and_drives_on() -> None:
    floor = IdealGround()
    end = OldBase(ConstantSpeedMotion(floor))
    base = DenningBase(put_on_noisy_line(end))
    assert base.ranges() is None and base.ranges() is None and end.asked == 1
    floor.held = True
    with pytest.raises(BaseFault, match="stalled"):
        base.move(0.5)
    contact = base.take_contact()
    assert contact is not None and (contact.by, contact.sigma_rad) == ("stall", AHEAD_SIGMA_RAD) and end.asked == 1
    floor.held = False
    assert base.move(0.2).move_m == 0.2
