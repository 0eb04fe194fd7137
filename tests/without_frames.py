"""What a mission decided, but for the coming and going of locale frames."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from logs.records import as_line

FRAMES = ("LocaleFrame", "FrameRequest")


def list_decided(decisions: Iterable[Mapping[str, Any]]) -> list[str]:
    """Each decision with what was observed before it, as text; without the cycles in which an act only asked."""
    decided, seen = list[str](), list[Any]()
    for data in decisions:
        seen += _without_frames(data["observed"])
        if data["made"] and all(entry["type"] == "FrameRequest" for entry in data["made"]):
            continue
        chosen = data["chosen"] and [data["chosen"]["source"], _without_names([data["chosen"]["trigger"]])]
        decided.append(as_line([data["focus"], chosen, seen, _without_frames(data["made"]), data["refused"]]))
        seen = []
    return decided


def _without_frames(entries: Iterable[Mapping[str, Any]]) -> list[Any]:
    return [{**entry, "because": _without_names(entry["because"])} for entry in entries if entry["type"] not in FRAMES]


def _without_names(refs: Iterable[str]) -> list[str]:
    return [ref for ref in refs if not ref.startswith(FRAMES)]
