"""What the driver of a Denning-style base says, when, and how long it waits: both sides of its bounds."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from itertools import pairwise

import pytest

from harvey.hardware.drivers.base_driver import BaseFault
from harvey.hardware.drivers.denning import DenningBase
from tests.serial_bench import COMMANDS
from world_models.entries import AROUND_SIGMA_RAD, MotorCommand
from world_models.entries.obstacle import AHEAD_SIGMA_RAD

TOKEN, OTHER, NONCE = "0000002A", "0000002B", "12345678"


def say(body: str) -> bytes:
    """A frame by the protocol's document: the CRC-32 of what stands between # and *."""
    return f"#{body}*{zlib.crc32(body.encode()):08X}\n".encode()


class HandMade:
    """A base that answers what the test says, after what the test says too; a clock of whole milliseconds."""

    def __init__(
        self, answer: Callable[[str, str, list[str]], str | None] = lambda verb, seq, words: None,
        before: Callable[[str, int, str, list[str]], Sequence[str]] = lambda token, seq, verb, words: (),
    ) -> None:
        self.answer, self.before = answer, before
        self.said: list[tuple[float, str, int, list[str]]] = []
        self.time_ms, self._out = 0, b""

    def now(self) -> float:
        return self.time_ms / 1000.0

    def write(self, data: bytes) -> None:
        for line in data.decode().splitlines():
            token, seq, verb, *words = line[1:-9].split(" ")
            self.said.append((self.now(), verb, int(seq), words))
            self._out += b"".join(map(say, self.before(token, int(seq), verb, words)))
            said = self.answer(verb, seq, words)
            said = self._usual(verb, words) if said is None else said
            if said:
                self._out += say(f"{TOKEN if verb == 'HELLO' else token} {seq} {said}")

    def _usual(self, verb: str, words: list[str]) -> str:
        return {"HELLO": f"HI {' '.join(words)} 0.5 1.25 0.25", "GO": f"DONE ok {' '.join(words[:2])} 1.5 2.5",
                "STOP": "DONE ok 0.0 0.0 0.0 0.0", "BEAT": f"HERE {' '.join(words)} 1.0 2.0 3.0 4.0",
                "TOUCH": "FELT none", "RANGES": f"ECHOES {' '.join(words)} 20 218 3000 1000 -"}[verb]

    def read(self, timeout_s: float) -> bytes:
        out, self._out = self._out, b""
        self.time_ms += 0 if out else max(1, round(1000.0 * timeout_s))
        return out

    def reopen(self) -> None:
        """Nothing was closed."""

    def close(self) -> None:
        """Nothing is open."""

    def times(self, verb: str) -> list[float]:
        return [when for when, name, _, _ in self.said if name == verb]


def connect(base: HandMade) -> DenningBase:
    driver = DenningBase(base, nonce=NONCE)
    driver.odometry()
    return driver


def faulted(driver: DenningBase, command: MotorCommand) -> BaseFault:
    with pytest.raises(BaseFault) as caught:
        driver.execute(command)
    return caught.value


def test_commands_are_numbered_from_one_and_questions_too() -> None:
    base = HandMade()
    driver = connect(base)
    for command in (MotorCommand(0.5, 0.25), MotorCommand(0.0, 0.5, 0.125), MotorCommand(0.0, 0.5, 9.0)):
        driver.execute(command)
    driver.odometry()
    assert [(verb, seq, words) for _, verb, seq, words in base.said] == [
        ("HELLO", 0, [NONCE]), ("BEAT", 0, ["1"]), ("GO", 1, ["0.5", "0.25"]), ("GO", 2, ["0.0", "0.5", "0.125"]),
        ("GO", 3, ["0.0", "0.5", "0.25"]), ("BEAT", 3, ["2"])]


@pytest.mark.parametrize("verb", ["GO", "BEAT", "HELLO"])
def test_what_is_not_answered_is_said_again_and_given_up_after_a_second(verb: str) -> None:
    base = HandMade()
    driver = DenningBase(base, nonce=NONCE)
    if verb != "HELLO":
        driver.odometry()
    began_s = base.now()
    base.said.clear()
    base.answer = lambda said, seq, words: "" if said == verb else None
    with pytest.raises(BaseFault, match=r"silent: nothing heard for 1 s") as caught:
        driver.execute(MotorCommand(0.0, 1.0)) if verb == "GO" else driver.odometry()
    assert not caught.value.stopped and base.now() - began_s == pytest.approx(1.05, abs=0.16)
    assert all(b - a == pytest.approx(0.15, abs=0.002) for a, b in pairwise(base.times(verb)))
    assert len(base.times(verb)) == 7 and len(base.times("STOP")) == (verb == "GO")


def test_a_motion_that_is_told_to_go_on_for_too_long_is_stopped() -> None:
    """Twice what the base's own speeds (1.25 rad/s, 0.25 m/s) make of it, and five seconds."""
    base = HandMade(lambda verb, seq, words: "RUN 0.25 0.125 1.0 2.0" if verb == "GO" else None)
    for command, longest_s in ((MotorCommand(-0.5, 0.5), 9.8), (MotorCommand(0.0, 0.5, 0.125), 13.0)):
        driver = connect(base)
        began_s = base.now()
        fault = faulted(driver, command)
        assert (fault.kind, fault.detail, fault.stopped) == ("stalled", f"not done after {longest_s} s", True)
        assert base.now() - began_s == pytest.approx(longest_s, abs=0.16) and base.times("STOP")
        assert fault.done is not None


@pytest.mark.parametrize(("done", "kind", "detail"), [
    ("watchdog 0.1 0.2 3.0 4.0", "watchdog", "it heard too little of us and stopped by itself"),
    ("stalled 0.1 0.2 3.0 4.0", "stalled", "its wheels were held"),
    ("stopped 0.1 0.2 3.0 4.0", "stopped", "the motion ended early: stopped"),
    ("ok 0.1 0.2 3.0", "nonsense", "expected DONE with five words, got 'ok 0.1 0.2 3.0'"),
])
def test_how_a_motion_may_end(done: str, kind: str, detail: str) -> None:
    base = HandMade(lambda verb, seq, words: f"DONE {done}" if verb == "GO" else None)
    fault = faulted(connect(base), MotorCommand(0.0, 1.0))
    assert (fault.kind, fault.detail, fault.stopped) == (kind, detail, True)
    if kind != "nonsense":
        assert fault.done is not None
        assert (fault.done.turn_rad, fault.done.move_m, fault.done.duration_s) == (0.1, 0.2, 3.0)


@pytest.mark.parametrize(("refusal", "kind", "stopped", "again"), [
    ("range", "refused", True, 1), ("busy", "refused", False, 2), ("session", "disconnected", True, 1),
])
def test_refusals(refusal: str, kind: str, stopped: bool, again: int) -> None:
    """A command out of range has no number; a base that has begun again is greeted again; else it is stopped first."""
    refusals = iter([refusal])
    base = HandMade(lambda verb, seq, words: (
        f"NO {word}" if verb == "GO" and (word := next(refusals, "")) else None))
    driver = connect(base)
    fault = faulted(driver, MotorCommand(0.0, 1.0))
    assert (fault.kind, fault.stopped) == (kind, stopped)
    base.said.clear()
    driver.move(0.5)
    told = [(verb, seq) for _, verb, seq, _ in base.said]
    before = {"range": [], "busy": [("STOP", 1)], "session": [("HELLO", 0)]}[refusal]
    assert told == [*before, ("GO", again)]


@pytest.mark.parametrize(("moved", "asks"), [(0.4986, False), (0.4984, True), (0.6, False)])
def test_a_move_that_claims_too_little_is_asked_what_it_touched(moved: float, asks: bool) -> None:
    """By more than 1.5 mm."""
    base = HandMade(lambda verb, seq, words: {"GO": f"DONE ok 0.0 {moved} 1.0 2.0",
                                              "TOUCH": "FELT bumper 0.5 0.25 7.0"}.get(verb))
    driver = connect(base)
    driver.move(0.5)
    contact = driver.take_contact()
    assert bool(base.times("TOUCH")) == asks and (contact is not None) == asks
    assert contact is None or (contact.by, contact.direction_rad, contact.sigma_rad, contact.when_s) == (
        "bumper", 0.5, 0.25, 7.0)


@pytest.mark.parametrize(("command", "moved", "sigma_rad"), [
    (MotorCommand(0.0, 0.5), 0.0, AHEAD_SIGMA_RAD), (MotorCommand(1.0, 0.5), 0.0, AROUND_SIGMA_RAD),
    (MotorCommand(1.0, 0.5), 0.1, AHEAD_SIGMA_RAD),
])
def test_held_wheels_in_a_turn_or_a_move(command: MotorCommand, moved: float, sigma_rad: float) -> None:
    base = HandMade(lambda verb, seq, words: f"DONE stalled 0.0 {moved} 1.0 2.0" if verb == "GO" else None)
    driver = connect(base)
    faulted(driver, command)
    contact = driver.take_contact()
    assert contact is not None and contact.by == "stall" and contact.sigma_rad == sigma_rad


@pytest.mark.parametrize(("speeds", "is_believed"), [
    ("0.5 1.0 0.25", True), ("0.5 0.0 0.25", False), ("0.5 1.0 -1.0", False),
])
def test_a_greeting_tells_speeds_that_are_some(speeds: str, is_believed: bool) -> None:
    base = HandMade(lambda verb, seq, words: f"HI {words[0]} {speeds}" if verb == "HELLO" else None)
    driver = DenningBase(base, nonce=NONCE)
    if is_believed:
        driver.odometry()
        return
    with pytest.raises(BaseFault, match="no answer to a greeting"):
        driver.odometry()
    assert base.now() == pytest.approx(2.0, abs=0.16)


def test_ranges_answer_their_own_question() -> None:
    base = HandMade()
    driver = connect(base)
    ranges = driver.ranges()
    assert ranges is not None and ranges.distances_m == (1.0, None)
    assert (ranges.sigma_m, ranges.half_beam_rad, ranges.max_range_m) == (0.02, 0.218, 3.0)
    assert ranges.directions_rad == pytest.approx((0.0, 3.141592653589793))
    base.answer = lambda verb, seq, words: f"ECHOES {int(words[0]) - 1} 20 218 3000 1000" if verb == "RANGES" else None
    began_s = base.now()
    assert driver.ranges() is None and base.now() - began_s == pytest.approx(1.05, abs=0.16)


WRONG: dict[str, tuple[str, str]] = {
    "DONE of the command before": ("GO", "{token} {before} DONE ok 0.9 0.9 9.0 9.0"),
    "DONE of a command to come": ("GO", "{token} {after} DONE ok 0.9 0.9 9.0 9.0"),
    "DONE of another session": ("GO", "{other} {seq} DONE ok 0.9 0.9 9.0 9.0"),
    "RUN of the command before": ("GO", "{token} {before} RUN 0.9 0.9 9.0 9.0"),
    "refusal of the command before": ("GO", "{token} {before} NO range"),
    "refusal of another session": ("GO", "{other} {seq} NO session"),
    "stall of the command before": ("GO", "{token} {before} DONE stalled 0.0 0.0 9.0 9.0"),
    "HERE of the question before": ("BEAT", "{token} {seq} HERE {asked_before} 9.0 9.0 9.0 9.0"),
    "HERE of another session": ("BEAT", "{other} {seq} HERE {asked} 9.0 9.0 9.0 9.0"),
    "HERE of the command before": ("BEAT", "{token} {before} HERE {asked} 9.0 9.0 9.0 9.0"),
    "HI to another greeting": ("HELLO", "{other} 0 HI 99999999 0.5 9.0 9.0"),
}
"""Answers of right checksum to something else: to which verb, and what is said before the right one."""


@pytest.mark.parametrize("wrong", list(WRONG))
def test_an_answer_to_something_else_is_none(wrong: str) -> None:
    """A line may keep a frame and deliver it after newer ones. Answers carry session, command and question."""

    def before(token: str, seq: int, verb: str, words: list[str]) -> Sequence[str]:
        when, said = WRONG[wrong]
        if verb != when:
            return ()
        asked = words[0] if verb == "BEAT" else "0"
        return [said.format(token=token, other=OTHER, seq=seq, before=max(0, seq - 1), after=seq + 1, asked=asked,
                            asked_before=int(asked) - 1)] if seq or "{before}" not in said else ()

    base = HandMade(before=before)
    driver = DenningBase(base, nonce=NONCE)
    for command in COMMANDS:
        report = driver.execute(command)
        assert (report.turn_rad, report.move_m) == (command.turn_rad, command.move_m)
        assert (report.duration_s, report.sim_time_s) == (1.5, 2.5)
        there = driver.odometry()
        assert (there.x_m, there.y_m, there.heading_rad, there.time_s) == (1.0, 2.0, 3.0, 4.0)
    assert len(base.times("HELLO")) == 1 and len(base.times("GO")) == len(COMMANDS)
