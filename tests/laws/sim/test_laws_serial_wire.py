"""Laws of the Denning-style line's bytes: what is said is understood at the other end, and noise is only noise."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from harvey.hardware.drivers import denning
from sim.emulators.denning_emulator import ConstantSpeedMotion, DenningEmulator
from sim.emulators.emulator import IdealGround

NOISE = st.binary(max_size=300)
WORDS = st.lists(st.text("abcdefghijklmnopqrstuvwxyz0123456789.-+", min_size=1, max_size=12), max_size=5).map(tuple)
FRAMES = st.builds(
    denning.Packet, st.integers(0, 2**32 - 1).map(lambda n: f"{n:08X}"), st.integers(0, 999_999_999),
    st.sampled_from(("GO", "STOP", "BEAT", "HELLO", "DONE")), WORDS,
)


@given(FRAMES)
def test_a_denning_frame_comes_back_as_it_was_said(frame: denning.Packet) -> None:
    assert denning.decode(denning.encode(frame).rstrip(b"\n")) == frame


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_number_on_the_denning_line_is_the_same_number_again(value: float) -> None:
    frame = denning.Packet("00000000", 1, "GO", (denning.number(value),))
    heard = denning.decode(denning.encode(frame).rstrip(b"\n"))
    assert heard is not None
    (again,) = heard.numbers(0, 1) or (math.nan,)
    assert again == value and math.copysign(1, again) == math.copysign(1, value)


@given(FRAMES, st.data())
def test_up_to_three_flipped_bits_never_make_another_denning_frame(
    frame: denning.Packet, data: st.DataObject
) -> None:
    line = bytearray(denning.encode(frame))
    places = data.draw(st.lists(st.integers(0, 8 * len(line) - 1), min_size=1, max_size=3, unique=True))
    for place in places:
        line[place // 8] ^= 1 << place % 8
    heard = list(denning.PacketDecoder().feed(bytes(line) + b"\n"))
    assert heard in ([], [frame])


@given(NOISE, FRAMES, NOISE)
def test_the_denning_decoder_finds_a_frame_in_noise(before: bytes, frame: denning.Packet, after: bytes) -> None:
    decoder = denning.PacketDecoder()
    heard = list(decoder.feed(before))
    heard += decoder.feed(denning.encode(frame))
    heard += decoder.feed(after + b"\n")
    assert frame in heard


@given(st.lists(FRAMES, max_size=4), st.integers(1, 7))
def test_frames_may_come_in_pieces(frames: list[denning.Packet], size: int) -> None:
    said = b"".join(denning.encode(frame) for frame in frames)
    decoder = denning.PacketDecoder()
    heard = [f for i in range(0, len(said), size) for f in decoder.feed(said[i:i + size])]
    assert heard == frames


@given(NOISE, st.integers(1, 8))
def test_bytes_of_any_kind_raise_nothing_at_either_end(noise: bytes, size: int) -> None:
    pieces = [noise[i:i + size] for i in range(0, len(noise), size)]
    decoder = denning.PacketDecoder()
    for piece in pieces:
        list(decoder.feed(piece))
    base = DenningEmulator(ConstantSpeedMotion(IdealGround()))
    for piece in pieces:
        base.receive(piece)
        base.advance(0.01)
        base.take()
