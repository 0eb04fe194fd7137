"""Counters of a few bits that wrap round, and what two readings of one tell."""

from __future__ import annotations


def to_signed(value: int, bits: int) -> int:
    """The number that this many low bits stand for, in two's complement."""
    half = 1 << (bits - 1)
    return ((value + half) & ((1 << bits) - 1)) - half


def step(before: int, after: int, bits: int) -> int:
    """By how much a wrapping counter went on: the smallest change that explains both readings."""
    return to_signed(after - before, bits)
