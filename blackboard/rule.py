"""rule: a knowledge source from a function."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from enum import IntEnum
from typing import Any

from blackboard.board import View
from blackboard.change import Change, Watch
from blackboard.condition import Condition
from blackboard.effect import Effect
from blackboard.knowledge_source import KnowledgeSource
from blackboard.ladder import Level

Act = Callable[[View, Any], Iterable[Effect]]
Bind = Callable[[View, Change], Any]


def rule(
    on: type[Any] | Watch | Iterable[type[Any] | Watch], writes: type[Any] | Iterable[type[Any]], *,
    needs: Iterable[Condition[Any]] = (), bind: Bind | None = None, priority: float = 0.5,
    level: IntEnum = Level.ACTION, closes: IntEnum | None = None,
) -> Callable[[Act], KnowledgeSource]:
    """Makes a knowledge source of a function that gets the view and the case, and yields effects; it has its name.

    Args:
        on: the kinds whose postings and revisions trigger it, or watches that say it more precisely.
        writes: the kinds that it may write.
        bind: finds the case, or None where the act could not come; without one, the case is the trigger.
        needs, priority, level, closes: as in :class:`~blackboard.knowledge_source.KnowledgeSource`.
    """
    members: dict[str, Any] = {
        "on": tuple(one if isinstance(one, Watch) else Watch(one) for one in _several(on)),
        "writes": _several(writes), "needs": tuple(needs), "priority": priority, "level": level, "closes": closes}
    if bind is not None:
        members["bind"] = lambda self, view, trigger: bind(view, trigger)

    def make(act: Act) -> KnowledgeSource:
        members["act"] = lambda self, view, case: act(view, case) or ()
        of_function = {"__doc__": act.__doc__, "__module__": act.__module__}
        made: KnowledgeSource = type(act.__name__, (KnowledgeSource,), {**members, **of_function})()
        return made

    return make


def _several(one_or_more: Any) -> tuple[Any, ...]:
    return (one_or_more,) if isinstance(one_or_more, type | Watch) else tuple(one_or_more)
