"""The real viewer without a window, where there is one: a machine without a graphics driver is asked once.

And the views that its window would have.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
import rerun.blueprint as rrb

from docs.tools.look import look
from logs.run_errors import RecordingError

_absent = list[str]()


def look_or_skip(recording: Path, folder: Path, cycles: Sequence[int]) -> list[str]:
    """What the views of a recording complain of at some cycles; skips the test where no viewer can start."""
    if not _absent:
        try:
            return look(recording, folder, cycles)
        except RecordingError as error:
            _absent.append(str(error))
    pytest.skip(f"no headless viewer here: {_absent[0]}")


def views(part: Any) -> Iterator[Any]:
    """All views in a container."""
    if isinstance(part, rrb.View):
        yield part
    else:
        for inner in part.contents:
            yield from views(inner)
