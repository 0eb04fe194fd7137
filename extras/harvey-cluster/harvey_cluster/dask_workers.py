"""Dask workers: cases over a cluster, by Dask's own schedulers (https://distributed.dask.org).

The scheduler has only a few cases a worker before it, so that it serves a hundred thousand as well as a hundred, and a
worker that joins is given its share. A case whose worker ended is done again by Dask. Dask cannot tell which of a dead
worker's cases ended it; so a case that it gives up is tried once more, with nothing beside it, and only what ends its
workers then is given up.
"""

from __future__ import annotations

import logging
import os
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from harvey.campaign.workers import MOST_KILLS, CaseAnswer, Killed, answer_case
from harvey.errors import BadInput

dask: Any = import_module("dask")  # annotated only in part
distributed: Any = import_module("distributed")

AHEAD = 2
"""Cases that each worker has before it, so that it never waits."""
COUNT_EVERY_S = 2.0
"""So often is asked how many workers there are."""
CONNECT_S = 20.0
CONFIG: Mapping[str, object] = {
    "distributed.scheduler.allowed-failures": MOST_KILLS - 1,
    "distributed.scheduler.worker-saturation": 1.0,
    "distributed.worker.daemon": True,
}


class DaskWorkers:
    """A :class:`~harvey.campaign.workers.ClusterWorkers`."""

    def map_on_cluster(
        self, work: Callable[[Any], Any], cases: Sequence[Any], cluster: str,
        tell: Callable[[str], None] | None = None,
    ) -> Iterator[tuple[int, CaseAnswer | Killed]]:
        """``cluster`` is ``local:N``, the address of a scheduler, or its file. Raises BadInput."""
        with _connect(cluster) as client:
            if tell is not None:
                tell(str(client.dashboard_link))
            suspects: list[int] = []
            try:
                for place, answer in _map(client, work, cases, range(len(cases)), alone=False):
                    if isinstance(answer, Killed):
                        suspects.append(place)
                    else:
                        yield place, answer
                yield from _map(client, work, cases, suspects, alone=True)
            except (distributed.client.FutureCancelledError, OSError) as error:
                raise BadInput(
                    f"--cluster {cluster}: the scheduler was lost ({error}); what was done is kept") from None

    def worker_command(self, address: str, number: int) -> list[str]:
        """One case at a time each."""
        where = [address] if "://" in address else ["--scheduler-file", os.fspath(Path(address).resolve())]
        return ["-m", "distributed.cli.dask_worker", *where, "--nworkers", str(number), "--nthreads", "1"]


DASK = DaskWorkers()


def _map(
    client: Any, work: Callable[[Any], Any], cases: Sequence[Any], places: Sequence[int], *, alone: bool
) -> Iterator[tuple[int, CaseAnswer | Killed]]:
    """Keep as many cases under way as the workers can take, or one at a time."""
    todo = deque(places)
    done: Any = distributed.as_completed(loop=client.loop)
    under_way: dict[Any, int] = {}
    most, counted_s = 1, -COUNT_EVERY_S
    while todo or under_way:
        if not alone and time.monotonic() - counted_s >= COUNT_EVERY_S:
            most, counted_s = max(1, AHEAD * sum(client.nthreads().values())), time.monotonic()
        while todo and len(under_way) < most:
            place = todo.popleft()
            future = client.submit(answer_case, work, cases[place], pure=False)
            under_way[future] = place
            done.add(future)
        future = next(done)
        place = under_way.pop(future)
        try:
            yield place, future.result()
        except distributed.scheduler.KilledWorker:
            yield place, Killed(MOST_KILLS)
        future.release()


@contextmanager
def _connect(cluster: str) -> Iterator[Any]:
    """A client of the cluster. Raises BadInput."""
    with dask.config.set(dict(CONFIG)):
        if cluster.startswith("local:"):
            number = cluster.removeprefix("local:")
            if not (number.isascii() and number.isdecimal() and 0 < int(number) <= 4096):
                raise BadInput(f"--cluster: expected local:N with a number from 1 to 4096, got {cluster!r}")
            local = distributed.LocalCluster(n_workers=int(number), threads_per_worker=1, dashboard_address=":0",
                                             silence_logs=logging.CRITICAL)
            try:
                with distributed.Client(local) as client:
                    yield client
            finally:
                with suppress(Exception):  # one that is just being replaced cannot be closed; all is known by now
                    local.close()
        else:
            with _find_scheduler(cluster) as client:
                yield client


def _find_scheduler(cluster: str) -> Any:
    try:
        if "://" in cluster:
            return distributed.Client(cluster, timeout=CONNECT_S)
        if not Path(cluster).is_file():
            raise BadInput("--cluster: expected local:N, tcp://host:port or the file of a scheduler (dask scheduler"
                           f" --scheduler-file FILE), got {cluster!r}")
        return distributed.Client(scheduler_file=cluster, timeout=CONNECT_S)
    except (OSError, ValueError, KeyError) as error:
        if isinstance(error, BadInput):
            raise
        raise BadInput(f"--cluster {cluster}: expected a Dask scheduler that answers, got: {error}") from None
