"""The knowledge sources round the board: those of the project, and those of other installed packages.

A new knowledge source of the project takes one file in the folder of its subject: it is found there. One of another
package takes an entry point of the group ``harvey.knowledge_sources``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType

from blackboard import KnowledgeSource, Ladder, Level, Registry, registry_of
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from knowledge_sources.settings import DEFAULT, Settings
from world_models.entries import LADDER
from world_models.entries.entry_kinds import KINDS
from world_models.files.toml.mission import Servo
from world_models.plugins import GUESTS_GROUP, SOURCES_GROUP, PluginError, load_plugin_classes

SUBJECTS = ("sketcher", "milestone_selector", "action", "milestone", "relocalizer", "goal", "model", "senses")
"""The folders of knowledge sources, in the order in which a mission meets them."""


def _find_sources() -> Iterator[type[KnowledgeSource]]:
    for subject in SUBJECTS:
        package = import_module(f"knowledge_sources.{subject}")
        for file in sorted(found.name for found in iter_modules(package.__path__)):
            module = import_module(f"{package.__name__}.{file}")
            yield from sources_of(module)


def sources_of(module: ModuleType) -> list[type[KnowledgeSource]]:
    """The knowledge sources that a module defines, as classes or as rules."""
    kinds = (found if isinstance(found, type) else type(found) for found in vars(module).values())
    return [kind for kind in kinds if kind.__module__ == module.__name__ and issubclass(kind, KnowledgeSource)]


KNOWLEDGE_SOURCES: tuple[type[KnowledgeSource], ...] = tuple(_find_sources())
"""Every knowledge source. The order does not matter: control comes from triggers, ratings and levels."""
OWN_KINDS: Registry = registry_of(KNOWLEDGE_SOURCES, KINDS)
"""The kinds of entries of the project: documents tell of these, whatever else is installed."""


def knowledge_sources(settings: Settings = DEFAULT) -> tuple[KnowledgeSource, ...]:
    """The project's knowledge sources."""
    return tuple(build(source, settings) for source in KNOWLEDGE_SOURCES)


def build(source: type[KnowledgeSource], settings: Settings) -> KnowledgeSource:
    """A knowledge source with the settings; one that needs none is built without."""
    return source(settings) if issubclass(source, RobotKnowledgeSource) else source()


@cache
def foreign_sources(group: str = SOURCES_GROUP) -> Mapping[str, type[KnowledgeSource]]:
    """The knowledge sources of other installed packages, by name; or those that sit only where a run names them.

    Raises:
        PluginError: one cannot be loaded, or is called otherwise than its entry point.
    """
    found = load_plugin_classes(group, KnowledgeSource)
    for name, source in found.items():
        if source.called() != name:
            raise PluginError(f"entry point {group}, {name}: expected the name of its class, {source.called()}")
    return found


@cache
def load_kinds() -> Registry:
    """The kinds of entries that may be on a board: those of the project and of every knowledge source there is."""
    foreign = (*foreign_sources().values(), *foreign_sources(GUESTS_GROUP).values())
    return registry_of((*KNOWLEDGE_SOURCES, *foreign), KINDS)


def servoing(servo: Servo) -> Ladder:
    """The levels that a scenario leaves on."""
    on = {Level.ACTION: servo.action, Level.PLAN: servo.plan, Level.GOAL: servo.goal}
    return replace(LADDER, off=frozenset(level for level, is_on in on.items() if not is_on))
