"""The shortest way through several stops in any order: exact to nine, by an approximation of networkx beyond."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

MOST_EXACT = 9
FAR_M = 1e6  # stands for a way that is not known: such a stop comes last


def order_stops(lengths_m: NDArray[np.float64], to_end_m: NDArray[np.float64]) -> tuple[int, ...]:
    """The order of n stops of the shortest way from a start.

    Args:
        lengths_m: (n+1, n+1) from place to place, the start first; infinite where no way is known [m].
        to_end_m: (n,) from each stop to where the way goes on afterwards; zeros where it ends at the last [m].
    """
    ways, ends = (np.where(np.isfinite(part), part, FAR_M) for part in (lengths_m, to_end_m))
    return _order_exactly(ways, ends) if len(ends) <= MOST_EXACT else _order_nearly(ways, ends)


def _order_exactly(ways: NDArray[np.float64], ends: NDArray[np.float64]) -> tuple[int, ...]:
    """By dynamic programming over sets of stops (Held and Karp)."""
    n = len(ends)
    best: dict[tuple[int, int], tuple[float, tuple[int, ...]]] = {
        (1 << stop, stop): (float(ways[0, stop + 1]), (stop,)) for stop in range(n)}
    for visited in range(1, 1 << n):
        for last in range(n):
            for stop in range(n):
                if visited & 1 << last and not visited & 1 << stop:
                    length, order = best[visited, last]
                    key = visited | 1 << stop, stop
                    further = length + float(ways[last + 1, stop + 1]), (*order, stop)
                    best[key] = min(best.get(key, further), further)
    return min((best[(1 << n) - 1, last][0] + float(ends[last]), best[(1 << n) - 1, last][1]) for last in range(n))[1]


def _order_nearly(ways: NDArray[np.float64], ends: NDArray[np.float64]) -> tuple[int, ...]:
    """A greedy tour, of which then each nine stops in a row are put in their best order; to go back costs an end."""
    import networkx as nx  # loaded when first used: hardly a task has so many stops
    from networkx.algorithms import approximation

    closed = ways + 1e-9  # a weight of 0 would be no edge
    closed[1:, 0] = ends + 1e-9
    np.fill_diagonal(closed, 0.0)
    tour = approximation.greedy_tsp(nx.from_numpy_array(closed, create_using=nx.DiGraph), source=0)
    for first in (*range(1, len(ends) - MOST_EXACT + 2, 2), *range(2, len(ends) - MOST_EXACT + 2, 2)):
        part = tour[first:first + MOST_EXACT]
        near, after = [tour[first - 1], *part], closed[part, tour[first + MOST_EXACT]]
        tour[first:first + MOST_EXACT] = [part[stop] for stop in _order_exactly(closed[np.ix_(near, near)], after)]
    return tuple(stop - 1 for stop in tour[1:-1])
