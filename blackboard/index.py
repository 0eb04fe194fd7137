"""Index: how entries of a type are found by what their values say, without going through them all."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

T_contra = TypeVar("T_contra", contravariant=True)


@dataclass(frozen=True, slots=True, eq=False)
class Index(Generic[T_contra]):
    """A question that is asked often: which entries of a type have a certain key?

    The board keeps the answer from the first time that it is asked, and brings it up to date with every change. Declare
    an index once, beside the questions that use it, and not anew for each question.

    Attributes:
        kind: the class of the values.
        key: what they are found by, a pure function of the value; None leaves an entry out.
        word: what the entries are that are not left out, for people: "open".
    """

    kind: type[Any]
    key: Callable[[T_contra], Hashable | None]
    word: str = ""
