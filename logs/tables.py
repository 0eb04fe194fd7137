"""Tables as plain text."""

from __future__ import annotations

import re
from collections.abc import Sequence


def table(columns: Sequence[str], rows: Sequence[Sequence[str]], *, last_is_summary: bool = False) -> str:
    """Columns as wide as what they hold; numbers to the right, words to the left."""
    lines = [list(columns), *(list(row) for row in rows)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(columns))]
    right = [bool(rows) and all(_is_number(row[i]) for row in rows) for i in range(len(columns))]
    shown = [_line(line, widths, right) for line in lines]
    rule = "-" * (sum(widths) + 2 * (len(widths) - 1))
    body = [*shown[1:-1], rule, shown[-1]] if last_is_summary and rows else shown[1:]
    return "\n".join([shown[0], rule, *body])


def _line(cells: Sequence[str], widths: Sequence[int], right: Sequence[bool]) -> str:
    out = [cell.rjust(w) if r else cell.ljust(w) for cell, w, r in zip(cells, widths, right, strict=True)]
    return "  ".join(out).rstrip()


def _is_number(cell: str) -> bool:
    """Whether it is one number, or a dash for one that is not known."""
    return re.fullmatch(r"[+-]?[\d.]+(e[+-]?\d+)?\s?%?|-|[+-]?inf|nan", cell) is not None
