"""What a mission has compiled, compiled beforehand, on all processors: ``python -m docs.tools.compiling``.

numba compiles a function when it is first called, one after the other, while the robot waits. Which functions a mission
calls, and with which types, stands in ``signatures.json`` (``python -m docs.tools.signatures`` writes it). What is
missing there is compiled when it is called, as ever. Nothing is compiled twice: numba keeps what it has compiled.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numba import from_dtype, types
from numba.core.dispatcher import Dispatcher
from tqdm import tqdm

FILE = Path(__file__).with_name("signatures.json")
ENTRY = "harvey.simulation.simulated_run", "logs.recording.writer"
"""What imports all that a mission imports: Python compiles that too, and keeps it where it may."""
EVERY = 10
"""Where the output is no terminal, a line for so many modules."""
Described = Mapping[str, Any] | str


def describe_type(given: Any) -> Described:
    """A type of numba for the file. Raises TypeError for one that no file can hold."""
    kind: Any = given  # numba states no types of its attributes
    if isinstance(given, types.Array):
        return {"of": str(kind.dtype), "dims": kind.ndim, "layout": kind.layout, "fixed": not kind.mutable}
    if isinstance(given, types.BaseTuple):
        parts: dict[str, Any] = {"parts": [describe_type(part) for part in kind.types]}
        made = getattr(kind, "instance_class", None)
        return parts if made is None else {"named": [made.__module__, made.__qualname__], **parts}
    if isinstance(given, types.Number | types.Boolean):
        return str(kind)
    raise TypeError(f"expected numbers, arrays and tuples of them, got {kind}")


def build_type(described: Described) -> Any:
    """The type that :func:`describe_type` told of."""
    if isinstance(described, str):
        return from_dtype(np.dtype(described))
    if "of" in described:
        item = from_dtype(np.dtype(described["of"]))
        return types.Array(item, described["dims"], described["layout"], readonly=described["fixed"])
    parts = [build_type(part) for part in described["parts"]]
    if "named" in described:
        module, name = described["named"]
        return _build_tuple(parts, getattr(importlib.import_module(module), name))
    return _build_tuple(parts)


_build_tuple: Any = types.BaseTuple.from_types


def list_compiled(modules: Sequence[str]) -> dict[str, list[tuple[str, list[Described]]]]:
    """What is compiled in this process, of the functions of some modules: by module, names and types of arguments."""
    found: dict[str, list[tuple[str, list[Described]]]] = {}
    for module in modules:
        for name, function in sorted(vars(importlib.import_module(module)).items()):
            if isinstance(function, Dispatcher) and function.py_func.__module__ == module:
                for signature in function.signatures:
                    found.setdefault(module, []).append((name, [describe_type(kind) for kind in signature]))
    return found


def compile_module(module: str, functions: Sequence[tuple[str, Sequence[Described]]]) -> str:
    """Compile functions of a module, or load them where that was done before; returns its name."""
    importlib.import_module("harvey")  # it settles which instructions the processor is used with
    there = importlib.import_module(module)
    for name, arguments in functions:
        getattr(there, name).compile(tuple(build_type(kind) for kind in arguments))
    return module


def main() -> None:
    """Compile all that the file names, the largest modules first."""
    listed: Mapping[str, Sequence[tuple[str, Sequence[Described]]]] = json.loads(FILE.read_text(encoding="utf-8"))
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        todo = [pool.submit(compile_module, module, listed[module])
                for module in sorted(listed, key=_measure_size, reverse=True)]
        todo += [pool.submit(compile_module, module, ()) for module in ENTRY]
        shown = tqdm(as_completed(todo), "   compiled", len(todo), disable=not sys.stderr.isatty(), leave=False)
        for number, done in enumerate(shown, 1):
            done.result()
            if shown.disable and number % EVERY == 0:
                print(f"   {number} of {len(todo)} modules", flush=True)


def _measure_size(module: str) -> int:
    spec = find_spec(module)
    return Path(spec.origin).stat().st_size if spec is not None and spec.origin else 0


if __name__ == "__main__":
    main()
