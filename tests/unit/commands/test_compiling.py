"""What is compiled beforehand is what a mission calls, with the types with which it calls it."""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba import njit, typeof
from numba.core.dispatcher import Dispatcher

from docs.tools.compiling import FILE, build_type, describe_type
from sim.render.pieces import Pieces

ROOT = Path(__file__).parents[3]
LISTED = json.loads(FILE.read_text(encoding="utf-8"))
COUNT = """
from numba.core import event
began = []
class Listener(event.Listener):
    def on_start(self, event): began.append(event.data["dispatcher"].py_func.__qualname__)
    def on_end(self, event): pass
event.register("numba:compile", Listener())
import sys, harvey
for mission in "lab-to-allens-office", "hallway-kidnap":
    harvey.run(mission, seed=1, out="{out}/" + mission)
print("compiled:", began, "compiler:", "numba.misc.cffiimpl" in sys.modules)
"""


@pytest.mark.parametrize("value", [
    1, 2.5, True, np.float32(1.0), np.zeros((2, 3)), np.zeros((2, 3), np.uint8).T, np.zeros(4, np.bool_),
    (np.zeros(2), np.zeros((2, 2), np.int32)), (np.zeros(2), (1, 2.0)), (1, 2), np.broadcast_to(np.zeros(2), (3, 2)),
    Pieces(*[np.zeros(1, np.int32)] * len(Pieces._fields)), Pieces(*range(len(Pieces._fields) - 1), 1.5)])  # type: ignore[arg-type]
def test_a_type_is_built_as_it_was_described(value: object) -> None:
    described = json.loads(json.dumps(describe_type(typeof(value))))
    assert build_type(described) == typeof(value)


def test_a_type_that_no_file_can_hold_is_refused() -> None:
    with pytest.raises(TypeError, match="numbers, arrays and tuples"):
        describe_type(typeof(njit(lambda: 1)))


@pytest.mark.parametrize("module", sorted(LISTED))
def test_each_function_that_is_listed_is_there(module: str) -> None:
    for name, arguments in LISTED[module]:
        function = getattr(importlib.import_module(module), name)
        assert isinstance(function, Dispatcher)
        assert [describe_type(build_type(argument)) for argument in arguments] == arguments


@pytest.mark.slow
def test_a_mission_has_nothing_left_to_compile(tmp_path: Path) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    subprocess.run([sys.executable, "-m", "docs.tools.compiling"], cwd=ROOT, env=environment, check=True)
    script = COUNT.format(out=tmp_path / "run")
    told = subprocess.run([sys.executable, "-c", script], cwd=ROOT, env=environment, check=True, capture_output=True,
                          text=True)
    assert told.stdout.splitlines()[-1] == "compiled: [] compiler: False"
