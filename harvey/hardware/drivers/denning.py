"""A base that speaks the Denning-style line protocol (docs/protocol-denning.md): its frames, and the driver.

A command has a number and is carried out at most once: the base answers a repetition by how far the first one has come.
So repeating it is the heartbeat, the question and the cure for what was lost, all in one.

One frame is one line of ASCII, ``#TOKEN SEQ VERB ARGUMENTS*CRC``; the CRC-32 (that of zlib) of what stands between
``#`` and ``*`` is in eight capital hexadecimal digits. Numbers are written so that reading them gives the same number
back.
"""

from __future__ import annotations

import math
import re
import secrets
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import get_args

from harvey.hardware.drivers.base_driver import LOOK_S, BaseFault, BaseKind, BytePipe, Driver
from world_models.entries import Contact, MotionReport, MotorCommand, Odometry, Ranges, Sense

LONGEST = 200
"""Bytes of a line; more without an end is noise."""

_LINE = re.compile(rb"#([0-9A-F]{8} (?:0|[1-9][0-9]{0,8}) [A-Z]+(?: [ -)+-~]+)?)\*([0-9A-F]{8})", re.ASCII)


@dataclass(frozen=True, slots=True)
class Packet:
    """One frame.

    Attributes:
        token: names the session; eight hexadecimal digits.
        seq: of the command that it is about.
        verb: what is said.
        words: the arguments.
    """

    token: str
    seq: int
    verb: str
    words: tuple[str, ...] = ()

    def numbers(self, first: int, count: int) -> tuple[float, ...] | None:
        """``count`` finite numbers from the word ``first`` on, the last of the frame; None where they are not there."""
        try:
            values = tuple(map(float, self.words[first:]))
        except ValueError:
            return None
        return values if len(values) == count and all(map(math.isfinite, values)) else None


def encode(frame: Packet) -> bytes:
    """The line of a frame."""
    body = " ".join((frame.token, str(frame.seq), frame.verb, *frame.words)).encode("ascii")
    return b"#%b*%08X\n" % (body, zlib.crc32(body))


def decode(line: bytes) -> Packet | None:
    """The frame of a line without its end; None where it is none, or was garbled."""
    match = _LINE.fullmatch(line)
    if match is None or zlib.crc32(match[1]) != int(match[2], 16):
        return None
    token, seq, verb, *words = match[1].decode("ascii").split(" ")
    return Packet(token, int(seq), verb, tuple(words))


class PacketDecoder:
    """Frames out of whatever bytes come; what is no frame is passed over and counted.

    Attributes:
        rejected: lines that were none.
    """

    def __init__(self) -> None:
        self._rest = b""
        self.rejected = 0

    def feed(self, data: bytes) -> Iterator[Packet]:
        """The frames that are complete with these bytes."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        self._rest = self._rest[-LONGEST:]
        for line in lines:
            frame = decode(line[max(0, line.rfind(b"#")):])
            if frame is not None:
                yield frame
            else:
                self.rejected += 1

    def clear(self) -> None:
        """Forget a line that was begun."""
        self._rest = b""


def parse_contact(frame: Packet) -> Contact | None:
    """The contact of a ``FELT``; None where nothing was touched, or it is none."""
    values, sense = frame.numbers(1, 3), next((s for s in get_args(Sense) if frame.words[:1] == (s,)), None)
    if values is None or sense is None or not (abs(values[0]) <= math.pi and values[1] > 0.0):
        return None
    return Contact(sense, *values)


def parse_ranges(words: Sequence[str], when_s: float) -> Ranges | None:
    """The ranges of an ``ECHOES`` without its question; None where the base has no sensors, or it is none.

    Words: sigma [mm], half of the beam [mrad], furthest echo [mm], then the distance of each sensor [mm] or ``-``.
    """
    if len(words) < 4 or not all(word.isdecimal() or (word == "-" and at > 2) for at, word in enumerate(words)):
        return None
    sigma_m, half_beam_rad, max_range_m = (int(word) / 1000.0 for word in words[:3])
    distances = tuple(None if word == "-" else int(word) / 1000.0 for word in words[3:])
    axes = tuple(math.remainder(math.tau * at / len(distances), math.tau) for at in range(len(distances)))
    return Ranges(axes, distances, sigma_m, half_beam_rad, max_range_m, when_s)


def number(value: float) -> str:
    """A number as it is written: what ``float`` reads back is the same number."""
    return repr(float(value))


BAUD = 38400
NOBODY = "00000000"
"""The token of a frame that belongs to no session yet."""

REPEAT_S = 0.15
"""What was not answered is said again after this."""

PATIENCE_S = 1.0
"""Silence of the base that is taken for a fault."""

SHORT_M = 0.0015
"""A move that claims less than was asked for, by more than this, was stopped by something."""


class DenningBase(Driver):
    """A base over the Denning-style protocol."""

    def __init__(self, link: BytePipe, *, nonce: str | None = None) -> None:
        """``nonce`` (eight hexadecimal digits) tells the answer to our greeting from one to an older greeting."""
        super().__init__(link)
        self._decoder = PacketDecoder()
        self._nonce = nonce or secrets.token_hex(4).upper()
        self._token = NOBODY
        self._seq = self._asked = 0
        self._unresolved = False
        self._speeds = (0.0, 0.0)
        self._has_senses = True

    def _carried_out(self, command: MotorCommand) -> MotionReport:
        self._ready()
        self._seq += 1
        self._unresolved = True
        slowly = () if command.speed_m_per_s is None else (number(min(command.speed_m_per_s, self._speeds[1])),)
        words = (number(command.turn_rad), number(command.move_m), *slowly)
        frame = Packet(self._token, self._seq, "GO", words)
        ends_s = self._link.now() + self._longest_s(command)
        for answer in self._answers(frame, ends_s):
            if answer.verb == "DONE":
                self._feel(answer, command)
                return self._report(answer)
        self._cancel()
        raise self._fault("stalled", f"not done after {self._longest_s(command):.1f} s", stopped=True)

    def _halt(self) -> None:
        if self._token == NOBODY:
            self._greet()
        self._cancel()

    def _read_odometry(self) -> Odometry:
        self._ready()
        self._asked += 1
        frame = Packet(self._token, self._seq, "BEAT", (str(self._asked),))
        for answer in self._answers(frame, self._link.now() + 2 * PATIENCE_S):
            values = answer.numbers(1, 4)
            if answer.verb == "HERE" and answer.words[0] == str(self._asked) and values is not None:
                return Odometry(*values)
        raise self._fault("silent", "no answer to a heartbeat")

    def _read_ranges(self) -> Ranges | None:
        self._ready()
        self._asked += 1
        question = str(self._asked)
        for answer in self._ask_more(Packet(self._token, self._seq, "RANGES", (question,))):
            if answer.verb == "ECHOES" and answer.words[:1] == (question,):
                return parse_ranges(answer.words[1:], self._link.now())
        return None

    def _feel(self, done: Packet, command: MotorCommand) -> None:
        """Ask what was touched, where the motion came to less than was asked for."""
        stalled = done.words[:1] == ("stalled",)
        moved_m = command.move_m if self._so_far is None else self._so_far.move_m
        if not stalled and moved_m > command.move_m - SHORT_M:
            return
        if stalled:
            self._contact = Contact.of_stall(self._link.now(), turning=moved_m == 0.0 and command.turn_rad != 0.0)
        for answer in self._ask_more(Packet(self._token, self._seq, "TOUCH")):
            if answer.verb == "FELT":
                self._contact = parse_contact(answer) or self._contact
                return

    def _ask_more(self, frame: Packet) -> Iterator[Packet]:
        """The answers to a question that a base need not understand; none of one that does not, or is silent."""
        if self._has_senses:
            try:
                yield from self._answers(frame, self._link.now() + PATIENCE_S)
            except BaseFault as fault:
                self._has_senses = fault.detail != "verb"
                if fault.kind not in ("refused", "silent"):
                    raise

    def _after_reopening(self) -> None:
        self._decoder.clear()

    def _ready(self) -> None:
        """A session, and no command of it that may still be carried out."""
        if self._stop_asked.is_set():
            raise self._fault("stopped", "a stop was asked for", stopped=True)
        if self._token == NOBODY:
            self._greet()
        if self._unresolved:
            self._cancel()

    def _greet(self) -> None:
        """Begin a session. A base that was moving in another one stops when it hears the first frame of this one."""
        hello = Packet(NOBODY, 0, "HELLO", (self._nonce,))
        for answer in self._answers(hello, self._link.now() + 2 * PATIENCE_S):
            values = answer.numbers(1, 3)
            if answer.verb == "HI" and answer.words[0] == self._nonce and values is not None and min(values) > 0:
                self._token, self._seq, self._unresolved = answer.token, 0, False
                self._speeds, self._has_senses = (values[1], values[2]), True
                return
        raise self._fault("silent", "no answer to a greeting")

    def _cancel(self) -> None:
        """The command of the present number is over, or never will begin; the base says which, and stands."""
        for answer in self._answers(Packet(self._token, self._seq, "STOP"), self._link.now() + 2 * PATIENCE_S):
            if answer.verb == "DONE":
                self._unresolved = False
                return
        raise self._fault("silent", "no answer to a stop")

    def _answers(self, frame: Packet, ends_s: float) -> Iterator[Packet]:
        """Say it, and again, and give what the base answers to it, until the caller has heard enough or time is up."""
        heard_s = self._link.now()
        while self._link.now() < ends_s:
            self._link.write(encode(frame))
            again_s = self._link.now() + REPEAT_S
            while (left := again_s - self._link.now()) > 0:
                for answer in self._decoder.feed(self._link.read(min(LOOK_S, left))):
                    if answer.verb == "NO" and answer.token == frame.token and answer.seq == frame.seq:
                        self._raise_refusal(answer)
                    if answer.verb == "HI" if frame.verb == "HELLO" else self._is_about(answer, frame):
                        heard_s = self._link.now()
                        self._note(answer)
                        yield answer
                if self._stop_asked.is_set() and frame.verb == "GO":
                    self._cancel()
                    raise self._fault("stopped", "a stop was asked for", stopped=True)
            if self._link.now() - heard_s > PATIENCE_S:
                self._give_up(frame)

    def _give_up(self, frame: Packet) -> None:
        """Nothing is heard. Perhaps we still are: say stop, and then nothing more, so that the watchdog strikes."""
        if frame.verb == "GO":
            self._link.write(encode(Packet(self._token, self._seq, "STOP")))
        noise = f", only noise ({self._decoder.rejected} lines so far)" if self._decoder.rejected else ""
        raise self._fault("silent", f"nothing heard for {PATIENCE_S:g} s{noise}")

    def _raise_refusal(self, answer: Packet) -> None:
        why = " ".join(answer.words)
        if answer.words[:1] == ("session",):
            self._token, self._unresolved = NOBODY, False
            raise self._fault("disconnected", "the base has begun again and knows nothing of us", stopped=True)
        if answer.words[:1] == ("range",):
            self._unresolved = False
            self._seq -= 1
        raise self._fault("refused", why, stopped=answer.words[:1] == ("range",))

    def _note(self, answer: Packet) -> None:
        """Keep what a frame says of the motion so far."""
        values = answer.numbers(1 if answer.verb == "DONE" else 0, 4)
        if answer.verb in ("RUN", "DONE") and values is not None:
            self._so_far = MotionReport(*values)

    def _report(self, answer: Packet) -> MotionReport:
        self._unresolved = False
        if self._so_far is None or not answer.words:
            received = " ".join(answer.words)
            raise self._fault("nonsense", f"expected DONE with five words, got {received!r}", stopped=True)
        if answer.words[0] == "watchdog":
            raise self._fault("watchdog", "it heard too little of us and stopped by itself", stopped=True)
        if answer.words[0] == "stalled":
            raise self._fault("stalled", "its wheels were held", stopped=True)
        if answer.words[0] != "ok":
            raise self._fault("stopped", f"the motion ended early: {answer.words[0]}", stopped=True)
        return self._so_far

    def _longest_s(self, command: MotorCommand) -> float:
        """Twice what the base's own speeds make of it, and some seconds."""
        turn_rate, speed = self._speeds
        speed = speed if command.speed_m_per_s is None else min(speed, command.speed_m_per_s)
        return 2.0 * (abs(command.turn_rad) / turn_rate + command.move_m / speed) + 5.0

    @staticmethod
    def _is_about(answer: Packet, frame: Packet) -> bool:
        return answer.token == frame.token and answer.seq == frame.seq


KIND = BaseKind("denning", BAUD, DenningBase, "its own, 0.5 s", lambda link: DenningBase(link, nonce="5E551057"))
"""With an emulated base the greeting is always the same, so that two runs send the same bytes."""
