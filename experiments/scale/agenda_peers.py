"""Peers of the agenda: py_trees, which has none, and CLIPS, whose agenda is in C; each step writes a line."""

from __future__ import annotations

import importlib
import importlib.util
import json
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from logs.disk import Appended

CLIPS_PENDING = "(defrule idle (declare (salience -100)) (waiting ?) => )"
CLIPS_WORK = "(defrule work ?task <- (task ?draw) => (retract ?task) (journal ?draw) (assert (task (+ ?draw 1))))"
PARTS = 3
TOOK = "took "


def has(peer: str) -> bool:
    """Whether a peer is installed: ``.venv/bin/pip install '.[peers]'``."""
    return importlib.util.find_spec(peer) is not None


def clips_s(pending: int, steps: int) -> float:
    """Measure one firing with this many activations of lower salience on the agenda; best of PARTS [s].

    The rule retracts its fact, has Python write a line, and asserts the fact that activates it again. It runs in a
    process of its own, because CLIPS prints remarks on its memory when it ends. Times are of the processor.
    """
    command = [sys.executable, "-m", __name__, str(pending), str(steps)]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return float(output.partition(TOOK)[2].split()[0])


def _clips_in_process_s(pending: int, steps: int) -> float:
    clips: Any = importlib.import_module("clips")
    environment = clips.Environment()
    with _Journal() as journal:
        environment.define_function(journal, "journal")
        environment.build(CLIPS_PENDING)
        environment.build(CLIPS_WORK)
        for number in range(pending):
            environment.assert_string(f"(waiting {number})")
        environment.assert_string("(task 0)")
        return _best_s(lambda: environment.run(steps), steps)


def py_trees_s(pending: int, steps: int) -> float:
    """Measure the processor time of one tick in which this many behaviours fail before one succeeds [s]."""
    py_trees: Any = importlib.import_module("py_trees")
    with _Journal() as journal:

        def act(behaviour: Any) -> Any:
            journal(behaviour.name)
            return py_trees.common.Status.SUCCESS

        base: Any = py_trees.behaviour.Behaviour
        worker = type("Worker", (base,), {"update": act})
        idle = type("Idle", (base,), {"update": lambda _behaviour: py_trees.common.Status.FAILURE})
        root = py_trees.composites.Selector("agenda", memory=False)
        root.add_children([*(idle(f"idle {number}") for number in range(pending)), worker("worker")])

        def tick() -> None:
            for _ in range(steps):
                root.tick_once()

        return _best_s(tick, steps)


def _best_s(run: Callable[[], object], steps: int) -> float:
    times_s = []
    for _ in range(PARTS):
        began_s = time.process_time()
        run()
        times_s.append((time.process_time() - began_s) / steps)
    return min(times_s)


class _Journal:
    """Writes a line for each step; the operating system has it before the call returns, as with ours."""

    def __enter__(self) -> _Journal:
        self._folder = TemporaryDirectory()
        self._file = Appended(Path(self._folder.name) / "journal.jsonl", "journal")
        return self

    def __call__(self, what: Any) -> None:
        self._file.append(json.dumps({"chosen": what}).encode() + b"\n")

    def __exit__(self, *_: object) -> None:
        self._file.close()
        self._folder.cleanup()


if __name__ == "__main__":
    print(f"{TOOK}{_clips_in_process_s(int(sys.argv[1]), int(sys.argv[2]))}")
