"""What documents take from the code and from files of results: written between two markers of a page.

``python -m docs.tools.fill`` writes it all again, with the schema of the journal and the picture of the architecture.
A page has ``<!-- generate: NAME -->``, what the generator of that name makes, and ``<!-- /generate -->``. A test
compares, so that no page tells of older code.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path

from docs.tools.architecture_picture import PICTURE, draw_architecture
from docs.tools.knowledge_source_table import describe_knowledge_sources
from docs.tools.site import journal
from docs.tools.site.command_line import describe_commands
from docs.tools.site.mission_files import (
    describe_faults,
    describe_hardware_tables,
    describe_scenario_tables,
    describe_shared_tables,
)
from docs.tools.site.python_page import describe_python
from docs.tools.site.setting_tables import describe_settings
from docs.tools.site.world_files import describe_world_keys
from docs.tools.status import describe_experiments, describe_ladder, describe_moments, describe_rows, describe_seeds
from harvey.wiring import KNOWLEDGE_SOURCES, OWN_KINDS
from world_models import frames

ROOT = Path(__file__).parents[2]
MARKED = re.compile(r"^<!-- generate: (\S+) -->\n(.*?)^<!-- /generate -->$", re.MULTILINE | re.DOTALL)


def describe_frames() -> str:
    """What the module of coordinate frames says of them."""
    return f"```text\n{(frames.__doc__ or '').strip()}\n```"


def show_example(name: str) -> str:
    """A program of ``examples/`` as a block."""
    return f"```python\n{(ROOT / 'examples' / name).with_suffix('.py').read_text(encoding='utf-8')}```"


def show_check() -> str:
    """What the dry run of the flat's mission prints."""
    command = [sys.executable, "-m", "harvey.cli", "run", "docs/flat/flat-sim.toml", "--check"]
    printed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return f"```\n{printed.partition(chr(10) * 2)[0]}\n```"


GENERATORS: Mapping[str, Callable[[], str]] = {
    "commands": describe_commands, "settings": describe_settings, "kinds": journal.describe_kinds,
    "shared-tables": describe_shared_tables, "hardware-tables": describe_hardware_tables,
    "scenario-tables": describe_scenario_tables, "faults": describe_faults, "world-keys": describe_world_keys,
    "frames": describe_frames, "python": describe_python, "knowledge-sources": describe_knowledge_sources,
    "check-flat": show_check, "experiments": describe_experiments, "seeds": describe_seeds,
    "ladder": describe_ladder, "moments": describe_moments,
    **{f"rows-{name}": partial(describe_rows, name)
       for name in ("table1", "figure12", "table2", "table3", "planning", "pose-speed", "levels")},
    "rows-fragments": partial(describe_rows, "table3", "60%"),
    **{f"example-{name}": partial(show_example, name)
       for name in ("hearsay", "sudoku", "recorded_model", "plugin/tests/test_timekeeper")},
}
"""What makes Markdown from the code, by the name that pages use."""


def fill(text: str) -> str:
    """A page's text with what its generators make now. Raises KeyError for a generator that there is not."""
    def replace(marked: re.Match[str]) -> str:
        made = re.sub(r"\n{3,}", "\n\n", GENERATORS[marked[1]]()).strip("\n")
        return f"<!-- generate: {marked[1]} -->\n{made}\n<!-- /generate -->"

    return MARKED.sub(replace, text)


def list_pages() -> Iterator[Path]:
    """Every document that has something generated in it."""
    for path in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))):
        if MARKED.search(path.read_text(encoding="utf-8")):
            yield path


def main() -> int:
    """Write what differs, and say which."""
    made = {path: fill(path.read_text(encoding="utf-8")) for path in list_pages()}
    made |= {journal.SCHEMA: journal.format_schema(), PICTURE: draw_architecture(KNOWLEDGE_SOURCES, OWN_KINDS)}
    for path, text in made.items():
        if path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
            print(path.relative_to(ROOT))
    return 0


if __name__ == "__main__":
    sys.exit(main())
