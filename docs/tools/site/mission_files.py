"""The reference of scenario and mission files, from the classes into which they are read."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, fields
from typing import Any

from docs.tools.site.markdown import describe_fields, summary, table
from harvey.hardware.hardware_mission import FORMAT as ON_HARDWARE
from sim.body.simulated_building import Helper
from sim.faults.fault_registry import BUILT_IN
from sim.ground_truth.table import ExtraThing, TrueDoor, TrueThing, TrueWall
from sim.ground_truth.things import MovedThing
from sim.scenario import FORMAT as SIMULATED
from sim.scenario import Attendant
from world_models.files.toml.mission import TABLES, Telling
from world_models.files.toml.settings_reader import spellings

LISTED: Mapping[str, type[Any]] = {
    "helper": Attendant, "moved": MovedThing, "rides": Helper,
    "truth.doors": TrueDoor, "truth.things": TrueThing, "truth.walls": TrueWall,
    "truth.extra": ExtraThing,
}
"""Tables of a scenario that may stand several times, as ``[[moved]]``."""


def describe_shared_tables() -> str:
    """What every mission may have, in the simulator and on hardware."""
    shared = [line for name, kind in TABLES.items() for line in _describe(f"[{name}]", kind)]
    return "\n".join([*shared, *_describe("[[told]]", Telling)])


def describe_hardware_tables() -> str:
    """What only the mission of a real robot has."""
    own = {name: kind for name, kind in ON_HARDWARE.tables.items() if name not in TABLES}
    return "\n".join(line for name, kind in own.items() for line in _describe(f"[{name}]", kind))


def describe_scenario_tables() -> str:
    """What only a scenario has; its ``[limits]`` are more than a mission's."""
    own = {name: kind for name, kind in SIMULATED.tables.items() if TABLES.get(name) is not kind} | SIMULATED.inner
    lines = [line for name, kind in own.items() for line in _describe(f"[{name}]", kind)]
    return "\n".join([*lines, *(line for name, kind in LISTED.items() for line in _describe(f"[[{name}]]", kind))])


def describe_faults() -> str:
    """The built-in kinds of ``[[faults]]``."""
    return "\n".join(line for kind in BUILT_IN for line in _describe(f'kind = "{kind.kind}"', kind))


def _describe(title: str, kind: type[Any]) -> Iterator[str]:
    yield from (f"### `{title}`", "", summary(kind))
    known = describe_fields(kind)
    yield from table(("key", "default", "meaning"), [
        (_spell(field.name), _format_default(field), known.get(field.name, "")) for field in fields(kind)])


def _spell(name: str) -> str:
    """A key with its other spellings."""
    own, *others = spellings(name)
    return f"`{own}`" + "".join(f", `{other}`" for other in others)


def _format_default(field: Any) -> str:
    value = field.default if field.default_factory is MISSING else field.default_factory()
    if value is MISSING:
        return "must be given"
    if isinstance(value, bool):
        return "`true`" if value else "`false`"
    if isinstance(value, float):
        return "" if math.isnan(value) else f"`{value:.6g}`{_in_degrees(field.name, value)}"
    return "" if value is None else f"`{value!r}`".replace("()", "[]").replace("'", '"')


def _in_degrees(name: str, value: float) -> str:
    return f" ({math.degrees(value):.4g} degrees)" if value and name.endswith("_rad") else ""
