"""rule: a knowledge source from a function."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from enum import IntEnum
from typing import Any

from blackboard.board import View
from blackboard.change import Change, Watch
from blackboard.effect import Effect
from blackboard.knowledge_source import KnowledgeSource
from blackboard.level import Level

Act = Callable[[View, Any], Iterable[Effect]]
Bind = Callable[[View, Change], Any]


class Rule(KnowledgeSource):
    """A knowledge source whose act is a function; its name is the function's."""

    def __init__(self, act: Act, bind: Bind | None) -> None:
        self._act, self._bind = act, bind

    @property
    def name(self) -> str:
        return self._act.__name__

    def bind(self, view: View, trigger: Change) -> Any | None:
        return trigger if self._bind is None else self._bind(view, trigger)

    def act(self, view: View, case: Any) -> Iterable[Effect]:
        return self._act(view, case) or ()


def rule(
    on: type[Any] | Watch | Iterable[type[Any] | Watch], writes: type[Any] | Iterable[type[Any]], *,
    bind: Bind | None = None, priority: float = 0.5, level: IntEnum = Level.ACTION, closes: IntEnum | None = None,
) -> Callable[[Act], Rule]:
    """Makes a knowledge source of a function that gets the view and the case, and yields effects.

    Args:
        on: the kinds whose postings and revisions trigger it, or watches that say it more precisely.
        writes: the kinds that it may write.
        bind: finds the case, or None where the act could not come; without one, the case is the trigger.
        priority, level, closes: as in :class:`~blackboard.knowledge_source.KnowledgeSource`.
    """
    watches = tuple(one if isinstance(one, Watch) else Watch(one) for one in _several(on))
    attributes = {"on": watches, "writes": _several(writes), "priority": priority, "level": level, "closes": closes}

    def make(act: Act) -> Rule:
        made: Rule = type(act.__name__, (Rule,), {**attributes, "__doc__": act.__doc__})(act, bind)
        return made

    return make


def _several(one_or_more: Any) -> tuple[Any, ...]:
    return (one_or_more,) if isinstance(one_or_more, type | Watch) else tuple(one_or_more)
