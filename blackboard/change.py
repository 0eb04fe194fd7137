"""Change and Watch: the only things that trigger a knowledge source."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from blackboard.entry import Entry, Ref
from blackboard.kinds import always, observation


class _Happened(NamedTuple):
    entry: Entry[Any]
    because: tuple[Ref, ...] = ()


class Change(_Happened):
    """Something that happened to one entry.

    Attributes:
        entry: the revision that it left behind.
        because: what a retraction rests on; what an entry rests on stands in the entry.
    """

    __slots__ = ()

    @property
    def kind(self) -> str:
        return type(self).__name__

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and tuple.__eq__(self, other)

    __hash__ = _Happened.__hash__


class Posted(Change):
    """A new entry."""

    __slots__ = ()


class Revised(Change):
    """A new revision of an entry."""

    __slots__ = ()


class Retracted(Change):
    """An entry is no longer believed; ``entry`` is its last revision."""

    __slots__ = ()


@observation(keep=1)
@dataclass(frozen=True, slots=True)
class Quiescence:
    """The value of an entry that is posted when nothing is left to do: stillness is a change too.

    Attributes:
        cycle: after which the board fell still.
    """

    cycle: int

    def sentence(self) -> str:
        return f"nothing was left to do after cycle {self.cycle}"


@dataclass(frozen=True, slots=True)
class Watch:
    """The kind of change that interests a knowledge source.

    Attributes:
        value_type: the value's class.
        kinds: which changes.
        where: a pure predicate on the value.
    """

    value_type: type[Any]
    kinds: tuple[type[Change], ...] = (Posted, Revised)
    where: Callable[[Any], bool] = always

    def is_for(self, change: type[Change], value: type[Any]) -> bool:
        """Whether it asks its predicate of such a change of such a value at all."""
        return issubclass(change, self.kinds) and issubclass(value, self.value_type)

    def sees(self, change: Change) -> bool:
        value = change.entry.value
        return self.is_for(type(change), type(value)) and self.where(value)
