"""Condition: what a knowledge source needs of the board. It has a name, finds something, or says what is so instead."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from blackboard.board import View

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Condition(Generic[T]):
    """What must be so before a knowledge source can act; declared once, and listed by each source that needs it.

    Attributes:
        name: what is needed, in words, as after "it needs".
        find: finds it on the board; None or False where it is not so. Pure.
        otherwise: what is the case instead, in words; or a function of the board that says it.
    """

    name: str
    find: Callable[[View], T | None]
    otherwise: str | Callable[[View], str]

    def of(self, view: View) -> T:
        """What it finds: for a source that lists it. Raises LookupError where it does not hold."""
        found = self.find(view)
        if found is None:
            raise LookupError(f"expected {self.name}, but {self.tell_otherwise(view)}")
        return found

    def tell_otherwise(self, view: View) -> str:
        """What is so where it does not hold."""
        return self.otherwise if isinstance(self.otherwise, str) else self.otherwise(view)
