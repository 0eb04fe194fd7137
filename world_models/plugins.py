"""Plugins: what other installed packages add, found by their entry points.

============================  ==========================================================================
``harvey.knowledge_sources``  a class under ``blackboard.knowledge_source.KnowledgeSource``
``harvey.guest_sources``      the same, of one that sits only at the boards of runs that name it in ``run.json``
``harvey.bases``              a ``harvey.hardware.drivers.base_driver.BaseKind``
``harvey.cameras``            a ``harvey.hardware.drivers.capture.CameraKind``
``harvey.emulators``          a ``sim.emulators.emulator.EmulatorKind``
``harvey.faults``             a class under ``sim.faults.fault.Fault``
``harvey.loggers``            a class under ``logs.recording.logger.Logger``
``harvey.pages``              a ``harvey.runner.teller.PageKind``, named ``live``
``harvey.workers``            a ``harvey.campaign.workers.ClusterWorkers``, named ``dask``
``harvey.commands``           a ``harvey.commands.command.CliCommand``; of a verb: ``world.import``
``harvey.movers``             a ``sim.scenario.Company``, named ``walkers``
``harvey.scenarios``          a folder of scenario files, as a ``pathlib.Path``; an entry point may have any name
``harvey.renderers``          a ``sim.render.lights.LitRenderers``, named ``lit``
``harvey.experiments``        the ``run`` of an experiment, by its name
``harvey.importers``          by the ending of its files, a ``harvey_buildings.Importer``
``harvey.questions``          of a run's ``Timeline`` the questions that it answers, as ``logs.explain``'s ``KNOWN``
``harvey.run_exporters``      a ``logs.export.RunExporter``, named ``mcap``
``harvey.exporters``          a ``harvey_buildings.exporters.Exporter``
============================  ==========================================================================

An entry point's name is the one that Harvey knows. ``extras`` are added so too; one that is absent can be named.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib.metadata import EntryPoint, entry_points
from typing import Any

SOURCES_GROUP, GUESTS_GROUP = "harvey.knowledge_sources", "harvey.guest_sources"
"""The groups of knowledge sources: named in ``run.json`` and put round the board, so it is said once, here."""

COMMANDS_GROUP, PAGES_GROUP, CAMERAS_GROUP = "harvey.commands", "harvey.pages", "harvey.cameras"
QUESTIONS_GROUP = "harvey.questions"
WORKERS_GROUP, RENDERERS_GROUP, RUN_EXPORTERS_GROUP = "harvey.workers", "harvey.renderers", "harvey.run_exporters"
EXTRAS: Mapping[str, Mapping[str, str]] = {
    COMMANDS_GROUP: {**dict.fromkeys(("calibrate", "explore", "survey", "world.ledger"), "harvey-survey"),
                     "follow": "harvey-ros2", "directions": "harvey-words", "parse": "harvey-words",
                     "serve": "harvey-serve", **dict.fromkeys(("world.export", "world.import"), "harvey-buildings")},
    "harvey.experiments": {
        **dict.fromkeys(("calibrate", "explore", "survey"), "harvey-survey"), "driven-ways": "harvey-words",
        "imported-building": "harvey-buildings", "instructions": "harvey-words",
        "other-worlds": "harvey-miniworld", "people": "harvey-people", "rosmaps": "harvey-buildings",
        "watchers": "harvey-serve"},
    SOURCES_GROUP: dict.fromkeys(("problem_solver", "step_closer", "task_reader"), "harvey-words"),
    PAGES_GROUP: {"live": "harvey-serve"}, WORKERS_GROUP: {"dask": "harvey-cluster"},
    RENDERERS_GROUP: {"lit": "harvey-light"}, "harvey.movers": {"walkers": "harvey-people"},
    **{group: {"p2os": "harvey-bases", "create2": "harvey-bases", "ros2": "harvey-ros2"}
       for group in ("harvey.bases", "harvey.emulators")},
    CAMERAS_GROUP: {"ros2": "harvey-ros2"}, RUN_EXPORTERS_GROUP: {"mcap": "harvey-ros2"},
}
"""By group: the names that extras of this project have, each with its extra."""


class PluginError(ImportError):
    """What an installed package adds cannot be used: names the package, what was expected and what came."""


def list_plugins(group: str) -> Mapping[str, str]:
    """The names of a group, sorted, each with its package and version, as ``harvey-timekeeper 1.0``. Loads nothing."""
    return {point.name: _package(point) for point in _points(group)}


def load_plugins(group: str, kind: type[Any], *names: str) -> Mapping[str, Any]:
    """The instances of ``kind`` that a group points to, by name in order; those of some names. Raises PluginError."""
    return {point.name: _load(point, kind, lambda found: isinstance(found, kind))
            for point in _points(group) if not names or point.name in names}


def list_absent(group: str) -> Mapping[str, str]:
    """The names of a group that an extra which is not installed would add, each with what to install."""
    present = list_plugins(group)
    return {name: f"{extra}: pip install ./extras/{extra}" for name, extra in EXTRAS.get(group, {}).items()
            if name not in present}


def load_plugin_classes(group: str, kind: type[Any], *names: str) -> Mapping[str, type[Any]]:
    """The classes under ``kind`` that a group points to, by name in order; those of some names. Raises PluginError."""
    return {point.name: _load(point, kind, lambda found: isinstance(found, type) and issubclass(found, kind))
            for point in _points(group) if not names or point.name in names}


def _points(group: str) -> list[EntryPoint]:
    return sorted(entry_points(group=group), key=lambda point: point.name)


def _load(point: EntryPoint, kind: type[Any], fits: Callable[[Any], bool]) -> Any:
    where = f"{_package(point)}: entry point {point.group}, {point.name} = {point.value}"
    try:
        found = point.load()
    except Exception as error:  # whatever a foreign module raises while it is imported
        raise PluginError(f"{where}: expected to be importable, got {type(error).__name__}: {error}") from error
    if not fits(found):
        raise PluginError(f"{where}: expected a {kind.__module__}.{kind.__qualname__}, got {found!r}")
    return found


def _package(point: EntryPoint) -> str:
    return "a package" if point.dist is None else f"{point.dist.name} {point.dist.version}"
