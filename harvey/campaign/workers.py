"""Workers: which processes work on the cases of a campaign, as the user chose with ``--workers`` and ``--cluster``."""

from __future__ import annotations

import os
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from harvey.errors import BadInput
from world_models.plugins import WORKERS_GROUP, list_absent, load_plugins

if TYPE_CHECKING:
    from harvey.campaign.case_work import CaseAnswer, Killed

DASK = "dask"
"""The name of the cluster's workers, as an entry point."""


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
            tell: is told where the dashboard is.

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


def add_worker_arguments(parser: ArgumentParser) -> None:
    """``--workers`` and ``--cluster``."""
    parser.add_argument("--workers", metavar="N", help="processes of this machine, or all: one a processor (all)")
    parser.add_argument("--cluster", metavar="WHERE",
                        help="let a Dask cluster work: local:N, tcp://host:port of a scheduler, or its scheduler file"
                             "; needs harvey-cluster")


def parse_workers(args: Namespace) -> Workers:
    """What :func:`add_worker_arguments` added. Raises BadInput."""
    number, cluster = args.workers, args.cluster
    if number is not None and cluster is not None:
        raise BadInput(f"--workers: expected it without --cluster, which has its own workers, got {number!r}")
    if number not in (None, "all") and not (number.isascii() and number.isdecimal() and 0 < int(number) <= 4096):
        raise BadInput(f"--workers: expected a number from 1 to 4096, or all, got {number!r}")
    if cluster is not None:
        find_cluster("--cluster")  # where it is absent that is said before anything is begun
    return Workers(None if number in (None, "all") else int(number), cluster)
