"""The loop of a run: cycle until there is an outcome. It knows neither simulator nor robot."""

from __future__ import annotations

from collections.abc import Callable

from blackboard.change import Quiescence
from blackboard.effect import Post
from blackboard.journal import Decision
from blackboard.scheduler import RAISED, Scheduler
from world_models.entries.task import Goal, Outcome

Over = Callable[[Scheduler], str | None]
"""Why a run has to end after this cycle, in words; None as long as it may go on."""


def endless(_scheduler: Scheduler) -> str | None:
    """No limit."""
    return None


def until_outcome(
    scheduler: Scheduler,
    *,
    over: Over = endless,
    before: Callable[[], None] = lambda: None,
    last: Decision | None = None,
) -> Outcome:
    """Cycle until an outcome is on the board, a limit is reached, an expert raises, or the board falls still for good.

    Stillness is told to the board once (``Quiescence``), so that somebody may answer it.

    Args:
        over: asked after each cycle whether a limit is reached.
        before: called before each cycle.
        last: the decision that was made last, where a run goes on that was cut off.
    """
    told_still = -1
    why = _why_over(last, scheduler, over) if last is not None else None
    while (declared := scheduler.view.latest(Outcome)) is None:
        if why is not None:
            return _declared(scheduler, why)
        before()
        decision = scheduler.step()
        if decision is not None:
            why = _why_over(decision, scheduler, over)
        elif told_still == scheduler.cycle:
            why = "the board fell still and nobody declared an outcome"
        else:
            scheduler.tell([Post(Quiescence(scheduler.cycle))], "scheduler")
            told_still = scheduler.cycle + 1
    scheduler.step()  # the outcome itself is seen, so that it stands in the journal
    return declared.value


def _why_over(decision: Decision, scheduler: Scheduler, over: Over) -> str | None:
    if decision.refused.startswith(RAISED):
        who = decision.chosen.source.name if decision.chosen else "an expert that was asked"
        return f"{who} raised {decision.refused.strip().splitlines()[-1]}"
    return over(scheduler)


def _declared(scheduler: Scheduler, reason: str) -> Outcome:
    """An outcome that nobody on the board declared; it is put there, and so into the journal."""
    outcome = Outcome("failed", reason)
    scheduler.tell([Post(outcome, scheduler.view.all(Goal)[-1:])], "mission")
    scheduler.step()
    return outcome
