"""Case work: what a worker does with one case, by which program, and several local processes that work.

Each local worker is an executor of one process that has one case at a time, so that it is known on which case it worked
when it ended. Another takes its place, and the case is done again.
"""

from __future__ import annotations

import ctypes
import gc
import multiprocessing
import os
import signal
import socket
import sys
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Any

from harvey.campaign.workers import count_processors
from harvey.errors import BadInput
from logs.decided_by import arithmetic, digest_of, files_in

PACKAGES = ("blackboard", "world_models", "knowledge_sources", "sim", "logs", "harvey")
MOST_KILLS = 3
"""So often may a worker end while it works on a case; then the case is given up."""
STOPPED_BY_SIGNAL = 143
"""The exit code of a process that SIGTERM ended."""


def origin() -> dict[str, str]:
    """Code and processor that compute the results."""
    return {"code": code_digest(), "arithmetic": arithmetic()}


@cache
def code_digest() -> str:
    """Digest of the code that results follow from."""
    root = Path(__file__).resolve().parents[2]
    files = [files_in(root, package, (".py", ".toml")) for package in PACKAGES]
    return digest_of({name: path for package in files for name, path in package.items()})


@dataclass(frozen=True, slots=True)
class CaseAnswer:
    """What a worker found of a case.

    Attributes:
        value: what the work returned.
        seconds: what it took.
        worker: host and process.
        code, arithmetic: with which program, and how it calculated.
    """

    value: Any
    seconds: float
    worker: str
    code: str
    arithmetic: str


@dataclass(frozen=True, slots=True)
class Killed:
    """A case that was given up: each worker that had it ended before it answered.

    Attributes:
        kills: how many did.
    """

    kills: int

    @property
    def text(self) -> str:
        """In words."""
        return f"given up: the worker that had it was killed {self.kills} times, as when memory runs out"


def answer_case(work: Callable[[Any], Any], case: Any) -> CaseAnswer:
    """Work on a case, in a worker."""
    began = time.perf_counter()
    value = work(case)
    seconds = time.perf_counter() - began
    return_memory()
    return CaseAnswer(value, seconds, f"{socket.gethostname()}:{os.getpid()}", code_digest(), arithmetic())


def return_memory() -> None:
    """Give memory that the process no longer uses back to the system: it would lie about between what is kept."""
    gc.collect()
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):  # another C library than glibc gives it back by itself
            ctypes.CDLL(None).malloc_trim(0)


def check_origin(answer: CaseAnswer) -> None:
    """Refuse what another program found, or another kind of processor. Raises BadInput."""
    for what, theirs, ours in (("code", answer.code, code_digest()),
                               ("arithmetic", answer.arithmetic, arithmetic())):
        if theirs != ours:
            raise BadInput(f"worker {answer.worker}: expected the {what} of this machine ({ours}), got {theirs}: its"
                           " results would differ; start workers with 'harvey campaign worker'")


def map_locally(
    work: Callable[[Any], Any], cases: Sequence[Any], number: int | None
) -> Iterator[tuple[int, CaseAnswer | Killed]]:
    """(place in ``cases``, answer) as they are done, in whatever order; ``number`` of processes, None for all.

    When the caller stops, or is interrupted, the workers stop; each may close its files first. They also stop when the
    caller is killed. What ``work`` raises comes through.
    """
    most = min(number or count_processors(), len(cases))
    todo, kills = deque(range(len(cases))), Counter[int]()
    workers = [_Worker() for _ in range(most)]
    under_way: dict[Future[CaseAnswer], tuple[_Worker, int]] = {}

    def give(worker: _Worker) -> None:
        if todo:
            place = todo.popleft()
            under_way[worker.submit(work, cases[place])] = worker, place

    try:
        for worker in workers:
            give(worker)
        while under_way:
            ready, _ = wait(under_way, return_when=FIRST_COMPLETED)
            done: list[tuple[int, CaseAnswer | Killed]] = []
            for future in ready:
                worker, place = under_way.pop(future)
                try:
                    done.append((place, future.result()))
                except BrokenProcessPool:
                    kills[place] += 1
                    if kills[place] < MOST_KILLS:
                        todo.append(place)
                    else:
                        done.append((place, Killed(MOST_KILLS)))
                give(worker)
            for worker in workers:  # one that had nothing to do while a case came back
                if not any(worker is busy for busy, _ in under_way.values()):
                    give(worker)
            yield from done
    except BaseException:
        for worker in workers:
            worker.stop()
        for child in multiprocessing.active_children():
            child.terminate()
        raise
    finally:
        for worker in workers:
            worker.close()


class _Worker:
    """One process, and the next one where it ended."""

    def __init__(self) -> None:
        self._executor: ProcessPoolExecutor | None = None

    def submit(self, work: Callable[[Any], Any], case: Any) -> Future[CaseAnswer]:
        """Give it a case; one that ended while it had none is replaced."""
        try:
            return self._process().submit(_work_in_worker, work, case)
        except BrokenProcessPool:
            self.stop()
            return self._process().submit(_work_in_worker, work, case)

    def _process(self) -> ProcessPoolExecutor:
        if self._executor is None:
            spawn = multiprocessing.get_context("spawn")
            self._executor = ProcessPoolExecutor(1, mp_context=spawn, initializer=_become_worker)
        return self._executor

    def stop(self) -> None:
        """Take nothing else, without waiting."""
        if self._executor is not None:
            self._executor.shutdown(wait=False, cancel_futures=True)
            self._executor = None

    def close(self) -> None:
        """Wait until it has ended."""
        if self._executor is not None:
            self._executor.shutdown()


def _become_worker() -> None:
    """The parent decides when to stop, and whoever has none any more stops."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _exit)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """A parent that was killed cannot say so, and the queue of cases never ends by itself."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(STOPPED_BY_SIGNAL)


def _work_in_worker(work: Callable[[Any], Any], case: Any) -> CaseAnswer:
    """In a worker: one that is told to stop closes its files, and then takes nothing else."""
    try:
        return answer_case(work, case)
    except SystemExit:
        os._exit(STOPPED_BY_SIGNAL)


def _exit(_number: int, _frame: FrameType | None) -> None:
    sys.exit(STOPPED_BY_SIGNAL)
