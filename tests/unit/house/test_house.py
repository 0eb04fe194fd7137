"""Rules of the house that a reader of one file cannot see: who imports whom, and what no module may do."""

from __future__ import annotations

import ast
import importlib
import sys
import tomllib
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from world_models.plugins import EXTRAS

ROOT = Path(__file__).parents[3]
PACKAGES = ("blackboard", "world_models", "knowledge_sources", "sim", "logs", "harvey", "experiments")
DECIDING = ("blackboard", "world_models", "knowledge_sources")
FILES = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
SOURCES = {path.relative_to(ROOT): ast.parse(path.read_text(encoding="utf-8")) for path in FILES}


def module_name(path: Path) -> str:
    return ".".join(path.with_suffix("").parts).removesuffix(".__init__")


MODULES = {module_name(path): tree for path, tree in SOURCES.items()}


def imports(tree: ast.AST) -> Iterator[str]:
    """Every module that is imported anywhere in a file, ``from a import b`` as a and a.b."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports here are absolute"
            yield str(node.module)
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


DIRECT = {name: sorted(set(imports(tree))) for name, tree in MODULES.items()}


def reached_from(start: str) -> set[str]:
    """Every module that importing ``start`` brings along, through modules of this project and their packages."""
    reached: set[str] = set()
    ahead = [start]
    while ahead:
        name = ahead.pop()
        if name in reached:
            continue
        reached.add(name)
        parents = [name.rsplit(".", i)[0] for i in range(1, name.count(".") + 1)]
        ahead += [*DIRECT.get(name, ()), *(p for p in parents if p in MODULES)]
    return reached


def tops(names: set[str]) -> set[str]:
    return {name.split(".")[0] for name in names}


def calls(tree: ast.AST, *names: str) -> list[ast.Call]:
    """Calls of a plain name."""
    found = (node for node in ast.walk(tree) if isinstance(node, ast.Call))
    return [node for node in found if isinstance(node.func, ast.Name) and node.func.id in names]


def offenders(rule: Callable[[ast.Module], list[ast.AST]], packages: tuple[str, ...] = PACKAGES) -> list[str]:
    """Where a rule is broken, as ``path:line``."""
    chosen = {path: tree for path, tree in SOURCES.items() if path.parts[0] in packages}
    return [f"{path}:{node.lineno}" for path, tree in chosen.items() for node in rule(tree)]


def where(name: str, prefixes: tuple[str, ...]) -> bool:
    return any(name == prefix or name.startswith(prefix + ".") for prefix in prefixes)


@pytest.mark.parametrize("package", PACKAGES)
def test_packages_are_those_of_this_repository(package: str) -> None:
    found = importlib.import_module(package).__file__
    assert found is not None and Path(found).resolve() == (ROOT / package / "__init__.py").resolve()


def test_the_blackboard_needs_the_standard_library_only() -> None:
    for name in (n for n in MODULES if where(n, ("blackboard",))):
        assert tops(reached_from(name)) <= {"blackboard", *sys.stdlib_module_names}, name


@pytest.mark.parametrize(
    ("package", "others"),
    [
        ("knowledge_sources", {"sim", "logs", "harvey"}),
        ("world_models", {"sim", "logs", "harvey", "knowledge_sources"}),
        ("sim", {"logs", "harvey", "knowledge_sources"}),
    ],
)
def test_what_a_package_cannot_reach(package: str, others: set[str]) -> None:
    """Not by any chain of imports: what decides never sees the truth, and the truth borrows no perception."""
    assert [name for name in MODULES if where(name, (package,)) and tops(reached_from(name)) & others] == []


@pytest.mark.parametrize("package", ["knowledge_sources.methods", "sim", "harvey.hardware.drivers"])
def test_what_computes_or_moves_knows_entries_but_no_board(package: str) -> None:
    """Entries are marked as kinds of the blackboard; nothing else of it is imported, but by the entries themselves."""
    users = [name for name in MODULES if where(name, (package,))]
    assert [name for name in users if "blackboard" in tops(set(DIRECT[name]))] == []


@pytest.mark.parametrize(
    ("library", "allowed"),
    [
        ("rerun", ("logs",)),
        ("cv2", ("knowledge_sources.methods", "harvey.hardware.drivers", "sim")),
        ("serial", ("harvey.hardware.drivers", "sim")),
        ("starlette", ()),
        ("uvicorn", ()),
        ("random", ()),
        ("pickle", ()),
        ("marshal", ()),
        ("shelve", ()),
    ],
)
def test_libraries_are_imported_only_where_they_belong(library: str, allowed: tuple[str, ...]) -> None:
    users = {name for name, found in DIRECT.items() if library in tops(set(found))}
    assert not {name for name in users if not where(name, allowed)}


def test_no_extra_is_imported_by_what_it_extends() -> None:
    extras = {path.parent.name for path in (ROOT / "extras").glob("*/*/__init__.py")}
    assert extras
    core = [name for name in MODULES if not where(name, ("experiments",))]
    assert [name for name in core if tops(set(DIRECT[name])) & {"extras", *extras}] == []


def test_what_the_extras_add_is_known_where_they_are_absent() -> None:
    """So that one line says what to install; and none is named that no extra adds."""
    added: dict[str, dict[str, str]] = {group: {} for group in EXTRAS}
    for path in sorted((ROOT / "extras").glob("*/pyproject.toml")):
        project = tomllib.loads(path.read_text(encoding="utf-8"))["project"]
        for group in EXTRAS:
            added[group] |= dict.fromkeys(project.get("entry-points", {}).get(group, ()), project["name"])
        assert path.parent.name == project["name"]
    assert added == EXTRAS


def test_nothing_is_evaluated_or_executed() -> None:
    assert offenders(lambda tree: calls(tree, "eval", "exec", "compile", "__import__")) == []


MAKERS = ("list", "dict", "set", "bytearray", "defaultdict", "deque", "Counter", "OrderedDict", "default_rng")
READ_ONLY = ("Mapping", "Sequence", "Final", "Collection")


def is_mutable(value: ast.expr | None) -> bool:
    if isinstance(value, ast.Call):
        return ast.unparse(value.func).split(".")[-1] in MAKERS
    return isinstance(value, ast.List | ast.Dict | ast.Set | ast.ListComp | ast.DictComp | ast.SetComp)


def module_state(tree: ast.Module) -> list[ast.AST]:
    """What stands at a module's top level, is mutable, and is not typed as something that is only read."""
    held = [n for n in tree.body if isinstance(n, ast.Assign) and is_mutable(n.value)]
    typed = [n for n in tree.body if isinstance(n, ast.AnnAssign) and is_mutable(n.value)]
    changed = [n for n in ast.walk(tree) if isinstance(n, ast.Global)]
    named = [n for n in held if ast.unparse(n.targets[0]) != "__all__"]
    return [*named, *(n for n in typed if not ast.unparse(n.annotation).startswith(READ_ONLY)), *changed]


def test_modules_hold_no_state() -> None:
    assert offenders(module_state) == []


def is_a_count(call: ast.Call) -> bool:
    """Whether what is summed is a comparison, a truth value, a length or a whole number."""
    term = call.args[0].elt if isinstance(call.args[0], ast.GeneratorExp | ast.ListComp) else call.args[0]
    if isinstance(term, ast.Constant):
        return isinstance(term.value, int)
    if isinstance(term, ast.Call):
        return ast.unparse(term.func) in ("len", "isinstance", "int", "bool")
    return isinstance(term, ast.Compare) or (isinstance(term, ast.UnaryOp) and isinstance(term.op, ast.Not))


def test_floats_are_not_summed_by_the_built_in() -> None:
    """Its rounding changed with Python 3.12: decisions would differ between versions."""
    assert offenders(lambda tree: [c for c in calls(tree, "sum") if not is_a_count(c)], (*DECIDING, "sim")) == []


def draws_from_global_chance(tree: ast.AST) -> list[ast.AST]:
    drawn = (n for n in ast.walk(tree) if isinstance(n, ast.Attribute) and ast.unparse(n.value) == "np.random")
    return [n for n in drawn if n.attr not in ("Generator", "default_rng", "SeedSequence")]


def test_decisions_know_neither_wall_clock_nor_global_chance() -> None:
    clocks = {"time", "datetime", "random", "secrets", "uuid"}
    deciding = [name for name in MODULES if where(name, DECIDING) and not where(name, ("harvey.hardware.drivers",))]
    assert [name for name in deciding if tops(set(DIRECT[name])) & clocks] == []
    assert offenders(draws_from_global_chance) == []


def loops_over_sets(tree: ast.AST) -> list[ast.AST]:
    made = [*calls(tree, "set", "frozenset"), *(n for n in ast.walk(tree) if isinstance(n, ast.Set | ast.SetComp))]
    loops = [n.iter for n in ast.walk(tree) if isinstance(n, ast.For | ast.comprehension)] if made else []
    return [i for i in loops if i in made]


def test_no_set_is_gone_through_unsorted() -> None:
    """A set that is made on the spot has no order that is the same in every run."""
    assert offenders(loops_over_sets) == []


def test_every_module_says_what_it_is() -> None:
    assert [str(p) for p, tree in SOURCES.items() if p.name != "__init__.py" and not ast.get_docstring(tree)] == []


def test_a_public_class_and_a_file_have_their_name_for_themselves() -> None:
    """In the product and what extends it: who reads a name knows what it is, and who looks for it finds one.

    But ``Case``: what a rule binds, and its own file alone acts on.
    """
    files = [path for path in FILES if path.relative_to(ROOT).parts[0] != "experiments"]
    files += sorted(path for path in (ROOT / "extras").glob("*/harvey_*/**/*.py") if "experiments" not in path.parts)
    classes, names = defaultdict(list), defaultdict(list)
    for path in files:
        if path.name != "__init__.py":
            names[path.name].append(str(path.relative_to(ROOT)))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_") and node.name != "Case":
                classes[node.name].append(str(path.relative_to(ROOT)))
    assert names["scheduler.py"] == ["blackboard/scheduler.py"] and "extras" in str(names) and "Scheduler" in classes
    assert [(name, where) for name, where in (*names.items(), *classes.items()) if len(where) > 1] == []
