"""The sampler of ``harvey experiment cost``: all time is told, and each function's by its file."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from experiments.scale import cost
from harvey.errors import BadInput

BUSY_S = 0.3
BUSY = """
import time

def keep_busy():
    _loop()

def _loop():
    end_s = time.process_time() + {busy_s}
    while time.process_time() < end_s:
        pass
"""


def busy_loop(file: str) -> Callable[[], None]:
    """A function that keeps the processor busy, as if it were in a file of the project."""
    module: dict[str, Any] = {}
    exec(compile(BUSY.format(busy_s=BUSY_S), f"{cost.ROOT}{file}", "exec"), module)
    found: Callable[[], None] = module["keep_busy"]
    return found


def test_the_split_adds_up_and_a_busy_function_is_seen() -> None:
    method, act = busy_loop("sim/render/fake.py"), busy_loop("knowledge_sources/sketcher/fake_source.py")
    before_s = time.process_time()
    found = cost.measure(lambda: (method(), act()))
    assert sum(found.parts.values()) == pytest.approx(found.total_s)
    assert set(found.parts) == {cost.MODULES, cost.REST, cost.THREADS, "fake_source"}
    assert found.parts[cost.MODULES] >= before_s
    assert found.parts["fake_source"] > BUSY_S / 2 and found.parts[cost.REST] > BUSY_S / 2
    assert set(found.methods) == {"fake.keep_busy"}, "public functions of methods alone"
    assert found.methods["fake.keep_busy"] > BUSY_S / 2


def test_a_part_counts_for_what_it_calls_and_a_module_wherever_it_is_imported() -> None:
    """The innermost part counts; what a module does while it is imported is importing."""
    code = compile("def importing(work):\n    work()\n", "<frozen importlib._bootstrap>", "exec")
    module: dict[str, Any] = {}
    exec(code, module)
    act = busy_loop("knowledge_sources/goal/fake_source.py")
    with cost.Sampler() as sampler:
        module["importing"](act)
    assert sampler.parts[cost.MODULES] > BUSY_S / 2
    assert "fake_source" not in sampler.parts and not sampler.methods


def test_signal_and_timer_are_as_before_also_after_an_error() -> None:
    before = signal.getsignal(signal.SIGPROF), signal.getitimer(signal.ITIMER_PROF)
    with pytest.raises(ZeroDivisionError):
        cost.measure(lambda: 1 // 0)
    assert (signal.getsignal(signal.SIGPROF), signal.getitimer(signal.ITIMER_PROF)) == before


def test_another_thread_than_the_main_one_is_refused() -> None:
    refused: list[str] = []

    def attempt() -> None:
        try:
            cost.measure(lambda: None)
        except BadInput as error:
            refused.append(str(error))

    thread = threading.Thread(target=attempt)
    thread.start()
    thread.join()
    assert refused and "main thread" in refused[0]


def test_small_sources_share_a_row_and_all_rows_add_up() -> None:
    parts = {cost.MODULES: 2.0, cost.THREADS: 0.5, "matcher": 7.46, "motor": 0.02, "prober": 0.02}
    rows = {str(row[0]).strip(): row[1:] for row in cost._rows([cost.Cost(10.0, parts, {"see.find": 3.0})])}
    assert rows["matcher"] == (7.46,) and rows["other knowledge sources"] == (0.04,)
    assert "motor" not in rows and rows["see.find"] == (3.0,)
    split = [rows[name][0] for name in (*cost.PARTS, cost.REST, cost.THREADS, "matcher", "other knowledge sources")]
    assert sum(cell for cell in split if isinstance(cell, float)) == pytest.approx(10.0)
