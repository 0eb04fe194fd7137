"""KnowledgeSource: it watches the board, rates its own activations, and acts by returning effects."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Any, ClassVar

from blackboard.board import View
from blackboard.change import Change, Retracted, Watch
from blackboard.effect import Effect
from blackboard.level import Level


class KnowledgeSource(ABC):
    """One knowledge source. It keeps no memory between acts but the board; what it is built with must be immutable.

    Class attributes:
        level: the servo level (Figure 2) at which it works.
        closes: the servo loop that it closes, if any: switched off with that level.
        watches: the changes that trigger it.
        writes: the types of value that its effects may touch; the scheduler refuses any other.
    """

    level: ClassVar[Level]
    closes: ClassVar[Level | None] = None
    watches: ClassVar[tuple[Watch, ...]]
    writes: ClassVar[tuple[type[Any], ...]]

    has_own_word: ClassVar[bool]
    """Whether it says itself which triggers still stand; where not, the scheduler knows the answer without asking."""

    _called: ClassVar[str]

    def __init_subclass__(cls, **more: Any) -> None:
        super().__init_subclass__(**more)
        cls._called = re.sub(r"(?<!^)(?=[A-Z])", "_", cls.__name__).lower()
        cls.has_own_word = cls.still_valid is not KnowledgeSource.still_valid

    @classmethod
    def called(cls) -> str:
        """Its name, as far as the class tells."""
        return cls._called

    @property
    def name(self) -> str:
        """Its class name in snake case, as in the folder listing."""
        return self._called

    def rate(self, view: View, trigger: Change) -> float | None:
        """How well it could answer this trigger, 0..1; None when it could not. Pure."""
        return 0.5

    def still_valid(self, view: View, trigger: Change) -> bool:
        """Whether the trigger still stands; :meth:`rate` then tells whether it could be answered. Pure.

        A trigger stands while its entry is the current revision; a retraction stands for good. It is asked when the
        trigger's entry has changed, and again, with ``rate``, when the knowledge source is about to be chosen.
        """
        return isinstance(trigger, Retracted) or view.is_current(trigger.entry)

    @abstractmethod
    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        """The effects that it asks for: a pure function of the view and the trigger."""
