"""Which faults are still to come, and which of them are due."""

from __future__ import annotations

from dataclasses import dataclass, replace

from sim.faults.fault import Fault


@dataclass(frozen=True, slots=True)
class Progress:
    """Time and path length spent in one locale since the robot first entered it (or anywhere, for "")."""

    time_s: float = 0.0
    path_m: float = 0.0


@dataclass(frozen=True, slots=True)
class FaultSchedule:
    """The faults that are still to come, and what their triggers depend on.

    Attributes:
        pending: in the order of the scenario.
        progress: (locale, progress) for each locale that a fault names; "" counts everywhere.
    """

    pending: tuple[Fault, ...] = ()
    progress: tuple[tuple[str, Progress], ...] = ()

    @staticmethod
    def of(faults: tuple[Fault, ...]) -> FaultSchedule:
        """The schedule at the start of a run."""
        return FaultSchedule(faults, tuple((name, Progress()) for name in sorted({f.in_locale for f in faults})))

    def advance(self, time_s: float, path_m: float, locale: str) -> FaultSchedule:
        """The schedule after ``time_s`` and ``path_m`` more in ``locale``."""
        return replace(self, progress=tuple(
            (name, Progress(p.time_s + time_s, p.path_m + path_m) if name in ("", locale) else p)
            for name, p in self.progress
        ))

    def take_due(self, locale: str) -> tuple[tuple[Fault, ...], FaultSchedule]:
        """The faults that are due for a robot in ``locale``, and the schedule without them."""
        due = tuple(fault for fault in self.pending if self._is_due(fault, locale))
        return due, replace(self, pending=tuple(fault for fault in self.pending if fault not in due))

    def _is_due(self, fault: Fault, locale: str) -> bool:
        progress = dict(self.progress)[fault.in_locale]
        here = fault.in_locale in ("", locale)
        return here and progress.path_m >= fault.after_m and progress.time_s >= fault.after_s
