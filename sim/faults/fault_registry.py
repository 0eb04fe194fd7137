"""From the ``kind`` of a scenario's ``[[faults]]`` to the fault class: built in, or of another installed package."""

from __future__ import annotations

from sim.faults.built_in_faults import (
    Bump,
    CameraFrozen,
    CameraKnocked,
    CameraUnplugged,
    DroppedFrames,
    Kidnap,
    LateFrames,
    LightsOff,
    LinkLost,
    Nonsense,
    Occlusion,
    OdometryJumps,
    PicturesLag,
    Stall,
)
from sim.faults.fault import Fault
from world_models.files.toml.settings_reader import read_settings, suggest_keys
from world_models.files.toml.source import Node, WorldError
from world_models.plugins import PluginError, list_plugins, load_plugin_classes

GROUP = "harvey.faults"
"""Entry points of this group name fault classes; an entry point's name is the ``kind`` of its class."""
BUILT_IN: tuple[type[Fault], ...] = (
    Bump, Kidnap, LightsOff, Occlusion, LinkLost, Nonsense, Stall, CameraUnplugged, LateFrames, DroppedFrames,
    CameraFrozen, PicturesLag, CameraKnocked, OdometryJumps,
)


def list_fault_kinds() -> tuple[str, ...]:
    """Every ``kind`` that a scenario can name: the built-in ones first."""
    built_in = [fault_class.kind for fault_class in BUILT_IN]
    return tuple(dict.fromkeys([*built_in, *list_plugins(GROUP)]))


def find_fault_class(kind: str) -> type[Fault]:
    """The fault class of this kind. A built-in class goes before one of another package.

    Raises:
        KeyError: there is none.
        PluginError: an installed package names one that cannot be imported, or that is no class of this kind.
    """
    for fault_class in BUILT_IN:
        if fault_class.kind == kind:
            return fault_class
    found = load_plugin_classes(GROUP, Fault, kind)[kind]
    if (own := getattr(found, "kind", None)) != kind:
        raise PluginError(f"entry point {GROUP}, {kind}: expected a class with kind = {kind!r}, got {own!r}")
    return found


def read_fault(node: Node) -> Fault:
    """One of a scenario's ``[[faults]]``.

    Raises:
        WorldError: its kind is unknown, a key does not belong to its class, or a value is out of bounds.
    """
    if not isinstance(node.value, dict) or "kind" not in node.value:
        raise node.fail("a table with the key 'kind'")
    kind = node["kind"].text()
    try:
        fault_class = find_fault_class(kind)
    except KeyError:
        raise node["kind"].fail(suggest_keys(kind, list_fault_kinds())) from None
    except ImportError as error:
        raise WorldError(f"{node['kind'].place}: {error}") from error
    keys = {key: value for key, value in node.value.items() if key != "kind"}
    return read_settings(Node(keys, node.key, node.source), fault_class)
