"""KnowledgeSource: a rule. It watches the board, binds what it needs, and acts by returning effects."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterable
from enum import IntEnum
from typing import Any, ClassVar

from blackboard.board import View
from blackboard.change import Change, Watch
from blackboard.condition import Condition
from blackboard.effect import Effect
from blackboard.ladder import Level


class KnowledgeSource(ABC):
    """One knowledge source. It keeps no memory between acts but the board; what it is built with must be immutable.

    Its trigger, precondition and action are those of the classic blackboard systems (Hearsay-II, BB1): a change that it
    watches triggers it; where its ``needs`` are met, :meth:`bind` finds what it acts on, if anything, and :meth:`act`
    gets what was found. A trigger stands while its entry is the current revision; a retraction stands for good.

    Class attributes:
        level: the servo level (Figure 2) at which it works.
        closes: the servo loop that it closes, if any: switched off with that level.
        on: the changes that trigger it.
        needs: what must be so before it is asked at all.
        priority: how urgent its act is, 0..1, where no :meth:`rate` of its own tells from the case.
        writes: the types of value that its effects may touch; the scheduler refuses any other.
    """

    level: ClassVar[IntEnum] = Level.ACTION
    closes: ClassVar[IntEnum | None] = None
    on: ClassVar[tuple[Watch, ...]]
    needs: ClassVar[tuple[Condition[Any], ...]] = ()
    priority: ClassVar[float] = 0.5
    writes: ClassVar[tuple[type[Any], ...]]

    _called: ClassVar[str]

    def __init_subclass__(cls, **more: Any) -> None:
        super().__init_subclass__(**more)
        cls._called = re.sub(r"(?<!^)(?=[A-Z])", "_", cls.__name__).lower()

    @classmethod
    def called(cls) -> str:
        """Its name, as far as the class tells."""
        return cls._called

    @property
    def name(self) -> str:
        """Its class name in snake case, as in the folder listing."""
        return self._called

    def find_case(self, view: View, trigger: Change) -> Any | None:
        """What :meth:`bind` finds where its ``needs`` are met: asked on the trigger and for the choice."""
        return None if self.find_unmet(view) else self.bind(view, trigger)

    def find_unmet(self, view: View) -> Condition[Any] | None:
        """The first of its ``needs`` that is not met."""
        return next((need for need in self.needs if need.find(view) in (None, False)), None)

    def bind(self, view: View, trigger: Change) -> Any | None:
        """The case: all that the act takes, found; None when there is nothing to act on. Pure.

        Unless it says otherwise, the trigger is all that it takes. It is asked only where its ``needs`` are met.
        """
        return trigger

    def rate(self, case: Any) -> float:
        """How urgent a case is, 0..1: its ``priority``, unless it can tell by the case. Pure."""
        return float(self.priority)

    @abstractmethod
    def act(self, view: View, case: Any) -> Iterable[Effect]:
        """The effects that it asks for: a pure function of the view and what :meth:`bind` found."""
