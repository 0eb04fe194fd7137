"""A long journal made from a short one: the same run repeated, each time with later cycles and higher numbers.

It serves to measure how fast a long run is explained.
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
"""Cycles in an hour of driving."""


def repeat_lines(lines: list[str], cycles: int) -> Iterator[str]:
    """Yield at least ``cycles`` lines: the journal's own, then again with later cycles and higher numbers."""
    last = json.loads(lines[-1])["cycle"]
    counts = Counter[str]()
    for line in lines:
        for type, number in ENTRY.findall(line):
            counts[type] = max(counts[type], int(number))
    name = re.compile(rf"\b({'|'.join(map(re.escape, sorted(counts)))})-(\d+)\b")
    activations = max((int(n) for line in lines for n in re.findall(r'\{"number":(\d+),"source"', line)), default=0)
    for round_ in range(-(-cycles // len(lines))):
        for line in lines:
            renamed = name.sub(partial(_rename, counts, round_), line)
            yield CYCLE.sub(partial(_shift, round_ * last, round_ * activations), renamed)


def _rename(counts: Mapping[str, int], round_: int, match: re.Match[str]) -> str:
    return f"{match[1]}-{int(match[2]) + round_ * counts[match[1]]}"


def _shift(cycles: int, activations: int, match: re.Match[str]) -> str:
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
        for line in repeat_lines(lines, cycles):
            file.write(line + "\n")
    return target.stat().st_size
