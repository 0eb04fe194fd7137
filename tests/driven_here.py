"""A campaign whose trials are done in this process, by work that is given: what it makes of their ends is tested."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from experiments import drives, trials


def run_here(
    monkeypatch: pytest.MonkeyPatch, folder: Path, experiment: ModuleType, work: Callable[[Any], Any], **how: Any
) -> Any:
    """The report of an experiment whose missions end as ``work`` says; its table is kept in ``folder``."""
    def here(_: Any, jobs: Sequence[Any], *__: Any) -> list[Any]:
        return [work(job) for job in jobs]

    monkeypatch.setattr(trials, "RUNS", folder)
    monkeypatch.setattr(drives, "run_trials", here)
    return experiment.run(seed=0, **how)
