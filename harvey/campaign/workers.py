"""Workers: which processes work on cases, and how.

A worker has one case at a time, so that it is known on which case it worked when it ended. Another takes its place, and
the case is done again.
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
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Protocol, runtime_checkable

from harvey.errors import BadInput
from logs.decided_by import arithmetic, digest_of, files_in
from world_models.plugins import WORKERS_GROUP, list_absent, load_plugins

DASK = "dask"
"""The name of the cluster's workers, as an entry point."""
PACKAGES = ("blackboard", "world_models", "knowledge_sources", "sim", "logs", "harvey")
MOST_KILLS = 3
"""So often may a worker end while it works on a case; then the case is given up."""
STOPPED_BY_SIGNAL = 143
"""The exit code of a process that SIGTERM ended."""


@dataclass(frozen=True, slots=True)
class Workers:
    """Who works.

    Attributes:
        number: of processes of this machine; None for one a processor.
        cluster: a Dask cluster: ``local:N``, the address of a scheduler, or its file; None for processes of our own.
    """

    number: int | None = None
    cluster: str | None = None

    @property
    def text(self) -> str:
        """In a line."""
        return f"cluster {self.cluster}" if self.cluster else f"{self.number or count_processors()} local"


@dataclass(frozen=True, slots=True)
class CaseAnswer:
    """What a worker found of a case.

    Attributes:
        value: what the work returned.
        seconds: what it took.
        worker: host and process.
        origin: with which program, and how it calculated (:func:`origin`).
    """

    value: Any
    seconds: float
    worker: str
    origin: Mapping[str, str]


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


@runtime_checkable
class ClusterWorkers(Protocol):
    """Workers of a cluster: an extra brings them."""

    def map_on_cluster(
        self, work: Callable[[Any], Any], cases: Sequence[Any], cluster: str,
        tell: Callable[[str], None] | None = None,
    ) -> Iterator[tuple[int, CaseAnswer | Killed]]:
        """(place in ``cases``, answer) as they are done, in whatever order.

        Args:
            work: a function of a module that the workers can import too; each calls ``answer_case`` with it.
            cluster: as ``--cluster`` takes it.
            tell: called with where the dashboard is.

        Raises:
            BadInput: there is no such cluster, or it was lost. What ``work`` raises comes through.
        """
        ...

    def worker_command(self, address: str, number: int) -> list[str]:
        """Python's arguments for so many workers of a scheduler, by its address or its file."""
        ...


def find_cluster(asked_by: str) -> ClusterWorkers:
    """The workers that are installed. Raises BadInput, which says what to install, where there are none."""
    if needs := list_absent(WORKERS_GROUP).get(DASK):
        raise BadInput(f"{asked_by} needs {needs}")
    found: ClusterWorkers = load_plugins(WORKERS_GROUP, ClusterWorkers, DASK)[DASK]
    return found


_chosen: ContextVar[Workers] = ContextVar("workers", default=Workers())  # noqa: B039 (it is frozen)


def chosen_workers() -> Workers:
    """Those that the command was told to use."""
    return _chosen.get()


@contextmanager
def choose_workers(workers: Workers) -> Iterator[None]:
    """What is mapped over cases in this block is done by these."""
    before = _chosen.set(workers)
    try:
        yield
    finally:
        _chosen.reset(before)


def count_processors() -> int:
    """How many processors this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not Linux
        return os.cpu_count() or 1


@cache
def origin() -> Mapping[str, str]:
    """Code and processor that compute the results."""
    root = Path(__file__).resolve().parents[2]
    files = [files_in(root, package, (".py", ".toml")) for package in PACKAGES]
    code = digest_of({name: path for package in files for name, path in package.items()})
    return {"code": code, "arithmetic": arithmetic()}


def answer_case(work: Callable[[Any], Any], case: Any) -> CaseAnswer:
    """Work on a case, in a worker."""
    began = time.perf_counter()
    value = work(case)
    seconds = time.perf_counter() - began
    return_memory()
    return CaseAnswer(value, seconds, f"{socket.gethostname()}:{os.getpid()}", origin())


def return_memory() -> None:
    """Give memory that the process no longer uses back to the system: it would lie about between what is kept."""
    gc.collect()
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):  # another C library than glibc gives it back by itself
            ctypes.CDLL(None).malloc_trim(0)


def map_cases(
    work: Callable[[Any], Any], cases: Sequence[Any], workers: Workers | None = None,
    tell: Callable[[str], None] | None = None,
) -> Iterator[tuple[int, CaseAnswer | Killed]]:
    """(place in ``cases``, answer) as they are done, in whatever order; kept nowhere.

    Args:
        work: a function of a module, so that another process finds it; what it raises comes through.
        workers: who works; None for those that the command was told to use.
        tell: called with where a cluster's dashboard is.

    Raises:
        BadInput: the workers cannot be used, or one of them is another program or another kind of processor.
    """
    workers = workers or chosen_workers()
    if workers.cluster is not None:
        done = find_cluster("--cluster").map_on_cluster(work, cases, workers.cluster, tell)
    else:
        done = _map_locally(work, cases, min(workers.number or count_processors(), len(cases)) or 1)
    for place, answer in done:
        if isinstance(answer, CaseAnswer):
            check_origin(answer)
        yield place, answer


def check_origin(answer: CaseAnswer) -> None:
    """Refuse what another program found, or another kind of processor. Raises BadInput."""
    for what, ours in origin().items():
        if (theirs := answer.origin[what]) != ours:
            raise BadInput(f"worker {answer.worker}: expected the {what} of this machine ({ours}), got {theirs}: its"
                           " results would differ; start workers with 'harvey campaign worker'")


def _map_locally(
    work: Callable[[Any], Any], cases: Sequence[Any], number: int
) -> Iterator[tuple[int, CaseAnswer | Killed]]:
    """As :func:`map_cases`, by processes of this machine, each with a thread that waits for it.

    When the caller stops, or is interrupted, they stop; each may close its files first. They also stop when the caller
    is killed.
    """
    idle = SimpleQueue[ProcessPoolExecutor]()
    for _ in range(number):
        idle.put(_new_worker())
    lock, stopped = threading.Lock(), threading.Event()

    def answer(case: Any) -> CaseAnswer | Killed:
        for _ in range(MOST_KILLS):
            worker = idle.get()
            try:
                with lock:  # no process begins after all were stopped
                    if stopped.is_set():
                        raise CancelledError
                    asked = worker.submit(_work_in_worker, work, case)
                return asked.result()
            except BrokenProcessPool:
                worker.shutdown()
                worker = _new_worker()
            finally:
                idle.put(worker)
        return Killed(MOST_KILLS)

    threads = ThreadPoolExecutor(number)
    places = {threads.submit(answer, case): place for place, case in enumerate(cases)}
    try:
        for done in as_completed(places):
            yield places.pop(done), done.result()
    except BaseException:
        with lock:
            stopped.set()
        for child in multiprocessing.active_children():
            child.terminate()
        raise
    finally:
        threads.shutdown(cancel_futures=True)
        for _ in range(number):
            idle.get().shutdown()


def _new_worker() -> ProcessPoolExecutor:
    """One process, which begins with its first case."""
    return ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn"), initializer=_become_worker)


def _become_worker() -> None:
    """A worker ignores Ctrl-C, which is its parent's to answer, and ends with its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda _number, _frame: sys.exit(STOPPED_BY_SIGNAL))
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
