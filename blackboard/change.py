"""Change and Watch: the only things that trigger a knowledge source."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from blackboard.entry import Entry, Ref


@dataclass(frozen=True, slots=True)
class Change:
    """Something that happened to one entry; ``entry`` is the revision it left behind."""

    entry: Entry[Any]

    @property
    def kind(self) -> str:
        return type(self).__name__


@dataclass(frozen=True, slots=True)
class Posted(Change):
    """A new entry."""


@dataclass(frozen=True, slots=True)
class Revised(Change):
    """A new revision of an entry."""


@dataclass(frozen=True, slots=True)
class Retracted(Change):
    """An entry is no longer believed; ``entry`` is its last revision.

    Attributes:
        because: what the retraction rests on; what the entry rested on stands in the entry.
    """

    because: tuple[Ref, ...] = ()


@dataclass(frozen=True, slots=True)
class Quiescence:
    """The value of an entry that is posted when nothing is left to do: stillness is a change too.

    Attributes:
        cycle: after which the board fell still.
    """

    cycle: int


def always(_value: Any) -> bool:
    return True


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
