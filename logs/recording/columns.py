"""Columns: rows of components as the columns that rerun takes, the plain ones made without its detours."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any, Protocol

import numpy as np
import pyarrow as pa

Batch = Sequence[Any] | np.ndarray[Any, Any]
"""The values of one component in one row: none, one or many."""

Row = tuple[int, float, dict[str, Batch]]
"""Cycle, simulated time and components."""

PLAIN = (pa.utf8(), pa.float64(), pa.int64(), pa.uint32())
"""Types of values that Arrow takes as they are; uint32 is a colour."""

NANOSECONDS = pa.duration("ns")


class Columnar(Protocol):
    """Makes columns of components: an archetype of rerun, or what acts like one."""

    @classmethod
    def columns(cls, *args: Any, **kwargs: Any) -> Iterable[Any]:
        """One column for each component."""


@dataclass(frozen=True, slots=True)
class Column:
    """A component's values, row by row, as rerun's ``send_columns`` asks for them."""

    descriptor: Any
    values: pa.ListArray

    def component_descriptor(self) -> Any:
        """What the component is called."""
        return self.descriptor

    def as_arrow_array(self) -> pa.ListArray:
        """One list of values a row."""
        return self.values


@dataclass(frozen=True, slots=True)
class Times:
    """A timeline's values, row by row, as ``send_columns`` asks for them."""

    timeline: str
    values: pa.Array

    def timeline_name(self) -> str:
        """What the timeline is called."""
        return self.timeline

    def as_arrow_array(self) -> pa.Array:
        """One time a row."""
        return self.values


class Columns:
    """Makes columns; it learns from rerun what a component is called and of what type it is, and then makes plain ones
    itself, which takes a fifth of the time."""

    def __init__(self) -> None:
        self._plain: dict[tuple[type[Columnar], str], tuple[Any, pa.DataType]] = {}

    def of(
        self, kind: type[Columnar], names: Sequence[str], rows: Sequence[Row]
    ) -> tuple[list[Times], list[Any]]:
        """The timelines and the components of an entity's rows."""
        cycles, times_s, batches = zip(*rows, strict=True)
        durations = (1e9 * np.array(times_s)).round().astype("timedelta64[ns]")
        index = [Times("cycle", pa.array(cycles, pa.int64())), Times("sim_time", pa.array(durations, NANOSECONDS))]
        return index, [column for name in names for column in self._component(kind, name, [b[name] for b in batches])]

    def _component(self, kind: type[Columnar], name: str, batches: Sequence[Batch]) -> Iterator[Any]:
        lengths = [len(batch) for batch in batches]
        values = _joined(batches)
        if (kind, name) in self._plain:
            descriptor, of_type = self._plain[kind, name]
            offsets = np.zeros(len(lengths) + 1, np.int32)
            np.cumsum(lengths, out=offsets[1:])
            plain = map(_packed, values) if of_type == pa.uint32() else values
            yield Column(descriptor, pa.ListArray.from_arrays(offsets, pa.array(plain, of_type)))
            return
        columns = list(kind.columns(**{name: values}))
        if len(columns) == 1 and len(values):
            of_type = columns[0].as_arrow_array().type.value_type
            if of_type in PLAIN:
                self._plain[kind, name] = columns[0].component_descriptor(), of_type
        yield from columns if lengths == [1] * len(lengths) else [column.partition(lengths) for column in columns]


def _joined(batches: Sequence[Batch]) -> Batch:
    """All values one after the other."""
    if isinstance(batches[0], np.ndarray):
        return np.concatenate(batches)
    return list(chain.from_iterable(batches))


def _packed(colour: Sequence[int]) -> int:
    """Red, green, blue and opacity in one number, as rerun keeps colours."""
    red, green, blue, opacity = colour
    return red << 24 | green << 16 | blue << 8 | opacity
