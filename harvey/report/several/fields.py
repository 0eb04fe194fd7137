"""Columns of a report of several missions: what differs between them, with its unit."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

OUTCOMES = ("outcome", "verdict")
"""The field by which missions are told apart, the first that there is."""
IN_NAME = ("seed",)
"""Is left out: a mission's name says it."""
UNITS: Mapping[str, tuple[str, float]] = {
    "error_m": ("error mm", 1e3), "track_m": ("track mm", 1e3), "_m_per_s": (" m/s", 1.0),
    "_rad": (" deg", math.degrees(1.0)), "_m": (" m", 1.0), "_s": (" s", 1.0), "_px": (" px", 1.0),
}
"""By the end of a field's name, the first that fits: how it is called, and by what its values are multiplied."""
MOST_KINDS, MOST_CHARACTERS = 12, 40
"""A text with more values than this, or a longer one, is no kind: it stands in the last columns, without a filter."""

Value = str | float | None


@dataclass(frozen=True, slots=True)
class Field:
    """One column.

    Attributes:
        label: its name, with the unit.
        values: a text, a number in that unit, or None where it is not known; one a mission.
        is_number: whether the values are numbers; is_whole: whether they are whole ones.
        kinds: how often each text came, the most frequent first; empty where there are too many of them.
    """

    label: str
    values: Sequence[Value]
    is_number: bool = False
    is_whole: bool = False
    kinds: Mapping[str, int] | None = None

    def cell(self, number: int) -> str:
        """The value of a mission, for a person."""
        value = self.values[number]
        if not isinstance(value, float):
            return value or ""
        if self.is_whole and value.is_integer():
            return str(int(value))
        return f"{value:.2f}" if value == 0.0 or 0.01 <= abs(value) < 1e3 else f"{value:.3g}"


def read_fields(results: Sequence[Mapping[str, Any]]) -> tuple[list[Field], dict[str, str]]:
    """The columns, the outcome first and long texts last; and what is the same of all missions, by label."""
    rows = [_flat(result) for result in results]
    columns: list[Field] = []
    same: dict[str, str] = {}
    for key in sorted(dict.fromkeys(key for row in rows for key in row), key=lambda key: key not in OUTCOMES):
        field = _field(key, [row.get(key) for row in rows])
        if key in IN_NAME or all(value is None for value in field.values):
            continue
        if len(rows) > 1 and key not in OUTCOMES and len(set(field.values)) == 1:
            same[field.label] = field.cell(0)
        else:
            columns.append(field)
    return sorted(columns, key=lambda one: not one.is_number and not one.kinds), same


def _flat(result: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Parts of parts as ``milestones refuted``; lists are left out, they are for the run's own report."""
    found: dict[str, Any] = {}
    for key, value in result.items():
        if isinstance(value, dict):
            found |= _flat(value, f"{before}{key} ")
        elif not isinstance(value, list):
            found[before + key] = value
    return found


def _field(key: str, values: Sequence[Any]) -> Field:
    known = [value for value in values if value is not None]
    if known and all(isinstance(value, int | float) and not isinstance(value, bool) for value in known):
        end, (word, factor) = next(((end, unit) for end, unit in UNITS.items() if key.endswith(end)), ("", ("", 1.0)))
        label = key.removesuffix(end).replace("_", " ") + word
        return Field(label, [_number(value, factor) for value in values], True, all(isinstance(v, int) for v in known))
    texts = [_text(value) for value in values]
    kinds = Counter(text for text in texts if text is not None)
    is_kind = len(kinds) <= MOST_KINDS and all(len(kind) <= MOST_CHARACTERS for kind in kinds)
    return Field(key.replace("_", " "), texts, kinds=dict(kinds.most_common()) if is_kind else None)


def _number(value: Any, factor: float) -> float | None:
    """None for what is not known, or no number at all."""
    try:
        number = math.nan if value is None else float(value) * factor
    except OverflowError:
        number = math.inf
    return None if math.isnan(number) else number


def _text(value: Any) -> str | None:
    return None if value is None else {True: "yes", False: "no"}[value] if isinstance(value, bool) else str(value)


def count_outcomes(columns: Sequence[Field]) -> Iterator[tuple[str, int]]:
    """How often each outcome came; nothing where no field tells of one."""
    if columns and columns[0].label in OUTCOMES and columns[0].kinds:
        yield from columns[0].kinds.items()
