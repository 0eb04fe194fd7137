"""Entry: one immutable revision of something that is believed."""

from __future__ import annotations

from typing import Generic, NamedTuple, TypeVar

T_co = TypeVar("T_co", covariant=True)

new_tuple = tuple.__new__
"""Makes a NamedTuple of a tuple of all its fields in half the time of calling it, which goes through Python code."""


class Ref(NamedTuple):
    """Names one revision of one entry; written ``Goal-1.0``."""

    id: str
    revision: int

    def __str__(self) -> str:
        return f"{self.id}.{self.revision}"


class Entry(NamedTuple, Generic[T_co]):
    """One revision on the board.

    Attributes:
        id: ``<type of the value>-<number>``, the same for all revisions.
        revision: 0 for the first.
        value: a frozen dataclass; the board never looks inside.
        author: the knowledge source or port that wrote it.
        cycle: when.
        because: the revisions that it rests on, so that "why?" is a walk.
    """

    id: str
    revision: int
    value: T_co
    author: str
    cycle: int
    because: tuple[Ref, ...] = ()

    @property
    def ref(self) -> Ref:
        return new_tuple(Ref, self[:2])
