"""A long journal from a short one: the same run told over and over, each time with names and cycles of its own.

For measuring how fast a long run is explained; it is a journal like any other, but not one of a run that took place.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path

ENTRY = re.compile(r'"entry":"(\w+)-(\d+)\.')
CYCLE = re.compile(r'^\{"cycle":(\d+)|"since":(\d+)|\{"number":(\d+),"source"')
HOUR_CYCLES = 16_600
"""How many cycles an hour of driving takes."""


def lengthened(lines: list[str], cycles: int) -> Iterator[str]:
    """At least so many lines: the journal's own, then again with later cycles and higher numbers, and so on."""
    last = json.loads(lines[-1])["cycle"]
    counts = Counter[str]()
    for line in lines:
        for type, number in ENTRY.findall(line):
            counts[type] = max(counts[type], int(number))
    name = re.compile(rf"\b({'|'.join(map(re.escape, sorted(counts)))})-(\d+)\b")
    activations = max((int(n) for line in lines for n in re.findall(r'\{"number":(\d+),"source"', line)), default=0)
    for round_ in range(-(-cycles // len(lines))):
        for line in lines:
            renamed = name.sub(partial(_renamed, counts, round_), line)
            yield CYCLE.sub(partial(_shifted, round_ * last, round_ * activations), renamed)


def _renamed(counts: Mapping[str, int], round_: int, match: re.Match[str]) -> str:
    return f"{match[1]}-{int(match[2]) + round_ * counts[match[1]]}"


def _shifted(cycles: int, activations: int, match: re.Match[str]) -> str:
    if match[1]:
        return f'{{"cycle":{int(match[1]) + cycles}'
    if match[2]:
        return f'"since":{int(match[2]) + cycles}'
    return f'{{"number":{int(match[3]) + activations},"source"'


def write_hour(source: Path, target: Path, cycles: int = HOUR_CYCLES) -> int:
    """Write an hour's journal from a run's; returns its length in bytes. Raises OSError."""
    lines = source.read_text(encoding="utf-8").splitlines()
    target.parent.mkdir(parents=True, exist_ok=True)
    with target.open("w", encoding="utf-8", newline="\n") as file:
        for line in lengthened(lines, cycles):
            file.write(line + "\n")
    return target.stat().st_size
