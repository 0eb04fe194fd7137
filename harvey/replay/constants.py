"""The numbers that experts and methods state at the top of their files, and how to set one otherwise for a while."""

from __future__ import annotations

import ast
import importlib
import math
import pkgutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from types import ModuleType
from unittest.mock import patch

import knowledge_sources
from harvey.errors import BadInput
from world_models.files.toml.settings import parse_value, suggest_keys


@dataclass(frozen=True, slots=True)
class Constant:
    """A number that a file states.

    Attributes:
        value: as it stands there.
        places: (module, name) under which functions read it: its own and those that import it.
    """

    value: float
    places: tuple[tuple[str, str], ...]


@cache
def constants() -> Mapping[str, Constant]:
    """Every constant that can be set, as ``motor.LOOKAHEAD_M``.

    Left out is what is read while modules are imported (as defaults, or to make another constant) or by functions that
    are compiled with it: to set it then would change only a part of what rests on it.
    """
    modules = {name: importlib.import_module(name) for name in _module_names()}
    files = {name: _File(module) for name, module in modules.items()}
    return {f"{name.rpartition('.')[2]}.{key}": Constant(value, tuple(places))
            for name, file in files.items() for key, value in file.numbers().items()
            if (places := _places(name, key, files))}


@contextmanager
def set_for_a_while(settings: Sequence[tuple[str, str]]) -> Iterator[None]:
    """Sets constants until the end of the ``with``. Raises BadInput where there is none of that name."""
    patches = [patch.object(importlib.import_module(module), name, number)
               for key, value in settings for number in (_number(key, value),)
               for module, name in constants()[key].places]
    for one in patches:
        one.start()
    try:
        yield
    finally:
        for one in reversed(patches):
            one.stop()


def _number(key: str, value: str) -> float:
    known = constants()
    if key not in known:
        raise BadInput(f"--set {key}: expected servo.action, servo.plan, servo.goal or {suggest_keys(key, known)}, "
                       f"got {key!r}")
    number = parse_value(value)
    if isinstance(number, bool) or not isinstance(number, int | float) or not math.isfinite(number):
        raise BadInput(f"--set {key}: expected a number as {known[key].value:g}, got {value!r}")
    return int(number) if isinstance(known[key].value, int) and number == int(number) else float(number)


def _module_names() -> list[str]:
    """The experts' modules and those of their methods; the drivers of bases and cameras decide nothing."""
    found = pkgutil.walk_packages(knowledge_sources.__path__, "knowledge_sources.")
    return sorted(m.name for m in found if not m.ispkg and not m.name.startswith("harvey.hardware.drivers"))


def _places(module: str, key: str, files: Mapping[str, _File]) -> list[tuple[str, str]]:
    """Where functions read a constant; nowhere, if a module reads it while it is imported."""
    names = [(module, key), *((name, alias) for name, file in files.items() if (alias := file.imports(module, key)))]
    if any(alias in files[name].read_at_import for name, alias in names):
        return []
    return [(name, alias) for name, alias in names if alias in files[name].read_later]


class _File:
    """What the text of a module says of names."""

    def __init__(self, module: ModuleType) -> None:
        self._module = module
        with open(module.__file__ or "", encoding="utf-8") as text:
            self._tree = ast.parse(text.read())
        self.read_later: set[str] = set()
        self.read_at_import: set[str] = set()
        self._visit(self._tree, False)

    def numbers(self) -> dict[str, float]:
        """The upper-case numbers that it states."""
        targets = (t for node in self._tree.body if isinstance(node, ast.Assign) for t in node.targets)
        leaves = (leaf for target in targets for leaf in ast.walk(target) if isinstance(leaf, ast.Name))
        names = [leaf.id for leaf in leaves if leaf.id.isupper() and not leaf.id.startswith("_")]
        values = {name: getattr(self._module, name) for name in names}
        return {k: v for k, v in values.items() if isinstance(v, int | float) and not isinstance(v, bool)}

    def imports(self, module: str, key: str) -> str | None:
        """The name under which it imports a constant, if it does."""
        froms = (node for node in self._tree.body if isinstance(node, ast.ImportFrom) and node.module == module)
        return next((a.asname or a.name for node in froms for a in node.names if a.name == key), None)

    def _visit(self, node: ast.AST, later: bool) -> None:
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
            (self.read_later if later else self.read_at_import).add(node.id)
        if isinstance(node, ast.FunctionDef | ast.Lambda):
            body = node.body if isinstance(node, ast.FunctionDef) else [node.body]
            inside = set() if _is_compiled(node) else {id(part) for part in body}
            for child in ast.iter_child_nodes(node):
                self._visit(child, later or id(child) in inside)
            return
        for child in ast.iter_child_nodes(node):
            self._visit(child, later)


def _is_compiled(node: ast.AST) -> bool:
    """Whether it is a function that numba makes machine code of, constants and all."""
    decorators = node.decorator_list if isinstance(node, ast.FunctionDef) else []
    return any("jit" in ast.unparse(decorator) for decorator in decorators)
