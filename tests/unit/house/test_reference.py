"""The reference pages are made from the code; these are what a builder of the site would not be told."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import repeat

import pytest

import harvey
from docs.tools.site import journal, mission_files, python_page, setting_tables, world_files
from docs.tools.site.command_line import describe_commands
from harvey.cli import parser
from harvey.commands.listing import select_rows
from harvey.wiring import OWN_KINDS
from sim.scenario import FORMAT

DESCRIPTIONS = (
    mission_files.describe_shared_tables, mission_files.describe_hardware_tables,
    mission_files.describe_scenario_tables, mission_files.describe_faults, world_files.describe_world_keys,
    setting_tables.describe_settings,
)


@pytest.mark.parametrize("describe", DESCRIPTIONS)
def test_every_key_has_a_meaning(describe: Callable[[], str]) -> None:
    rows = [line for line in describe().splitlines() if line.startswith("| `")]
    assert rows
    assert [row for row in rows if not row.split("|")[3 if row.count("|") > 3 else 2].strip()] == []


def test_every_command_is_there_with_every_option() -> None:
    text = describe_commands()
    options = re.findall(r"--[a-z][\w-]+", parser().format_help())
    for name in parser()._subparsers._group_actions[0].choices:  # type: ignore[union-attr]
        assert f"## harvey {name}\n" in text
        options += re.findall(r"(?<![\w-])--[a-z][\w-]+", parser(name)._subparsers._group_actions[0]  # type: ignore
                              .choices[name].format_usage())
    assert [option for option in {*options} - {"--help", "--version"} if f"`{option}" not in text] == []


def test_every_setting_and_every_key_of_a_scenario_is_there() -> None:
    settings = setting_tables.describe_settings()
    assert [row.name for row in select_rows(None) if f"| `{row.name}` |" not in settings] == []
    tables = mission_files.describe_shared_tables() + mission_files.describe_scenario_tables()
    keys = map(str.rpartition, FORMAT.keys(), repeat("."))
    assert [key for table, _, key in keys if table and (f"`[{table}]`" not in tables or f"`{key}`" not in tables)] == []


def test_every_kind_of_entry_is_there() -> None:
    text = journal.describe_kinds()
    assert [name for name in OWN_KINDS if f"### {name}\n" not in text] == []


def test_the_schema_of_the_journal_is_current() -> None:
    """``python -m docs.tools.fill`` writes it; ``JOURNAL_VERSION`` is raised where a reader would fail."""
    assert journal.SCHEMA.read_text(encoding="utf-8") == journal.format_schema()


def test_the_page_of_python_has_everything_that_harvey_exports_once() -> None:
    assert sorted(name for names in python_page.GROUPS.values() for name in names) == sorted(harvey.__all__)
    page = python_page.describe_python()
    assert "decisions()" in page and "on_decision: Callable[[Decision], None] | None = None," in page
