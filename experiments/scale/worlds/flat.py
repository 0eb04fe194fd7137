"""The usual method, in a process of its own: all passages of a world as one flat networkx graph."""

from __future__ import annotations

import json
import sys
import time
from contextlib import closing
from pathlib import Path

import networkx as nx

from experiments.scale.worlds.probe import peak_mb


def main(path: str) -> None:
    """Read the graph, find a shortest path to the last locale, and print times and memory as JSON."""
    import sqlite3

    began = time.perf_counter()
    graph = nx.Graph()
    with closing(sqlite3.connect(f"{Path(path).resolve().as_uri()}?mode=ro", uri=True)) as file:
        graph.add_nodes_from(name for (name,) in file.execute("select name from frame where layer = 0 order by number"))
        graph.add_edges_from(file.execute("select locale, other from passage"))
    load_ms = 1000.0 * (time.perf_counter() - began)
    last = list(graph)[-1]
    began = time.perf_counter()
    nx.shortest_path(graph, "robot-laboratory", last)
    path_ms = 1000.0 * (time.perf_counter() - began)
    mb = peak_mb()
    print(json.dumps({"load_ms": load_ms, "path_ms": path_ms, "mb": mb}))


if __name__ == "__main__":
    main(*sys.argv[1:])
