"""Work over several processes: what each item gives follows from it alone, so their number changes only the time."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import islice
from types import FrameType
from typing import TypeVar

from harvey.errors import BadInput

T = TypeVar("T")
R = TypeVar("R")

AHEAD = 4
"""Items that each worker has before it, so that it never waits."""
TOLD_TO_STOP = 143
"""The exit code of a process that SIGTERM ended."""


def map_over_workers(work: Callable[[T], R], items: Sequence[T], workers: int | None = None) -> Iterator[tuple[int, R]]:
    """(place in ``items``, what ``work`` gives for it) as they are done, in whatever order.

    When the caller stops, or is interrupted, the workers stop; each may close its files first.

    Args:
        work: a function of a module, so that another process finds it.
        workers: how many; None for one a core.

    Raises:
        BadInput: a worker was killed from outside. What ``work`` raises comes through.
    """
    most = min(workers or os.cpu_count() or 1, len(items))
    if not most:
        return
    spawn = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(most, mp_context=spawn, initializer=_become_worker)
    try:
        waiting = iter(enumerate(items))
        under_way: dict[Future[R], int] = {}
        for number, item in islice(waiting, AHEAD * most):
            under_way[pool.submit(_work_in_worker, work, item)] = number
        while under_way:
            ready, _ = wait(under_way, return_when=FIRST_COMPLETED)
            for future in ready:
                yield under_way.pop(future), future.result()
            for number, item in islice(waiting, len(ready)):
                under_way[pool.submit(_work_in_worker, work, item)] = number
    except BrokenProcessPool:
        raise BadInput("a worker process was killed from outside, as when memory runs out") from None
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for child in multiprocessing.active_children():
            child.terminate()
        raise
    finally:
        pool.shutdown()


def _become_worker() -> None:
    """The parent decides when to stop."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _exit)


def _work_in_worker(work: Callable[[T], R], item: T) -> R:
    """In a worker: one that is told to stop closes its files, and then takes nothing else."""
    try:
        return work(item)
    except SystemExit:
        os._exit(TOLD_TO_STOP)


def _exit(_number: int, _frame: FrameType | None) -> None:
    sys.exit(TOLD_TO_STOP)
