"""The reference of the command line, from the parsers themselves."""

from __future__ import annotations

from argparse import Action, ArgumentParser, _SubParsersAction
from collections.abc import Iterator

from docs.tools.site.markdown import escape
from harvey.cli import EPILOG, parser


def describe_commands() -> str:
    """Every command: usage, arguments and examples."""
    top = parser()
    exit_codes = next(line for line in EPILOG.splitlines() if line.startswith("exit codes"))
    lines = [escape(exit_codes[0].upper() + exit_codes[1:]), ""]
    for name, command in _subparsers(top):
        lines += _describe(f"harvey {name}", command, "##")
    return "\n".join(lines)


def _subparsers(of: ArgumentParser) -> Iterator[tuple[str, ArgumentParser]]:
    for action in of._actions:
        if isinstance(action, _SubParsersAction):
            yield from action.choices.items()


def _describe(name: str, command: ArgumentParser, heading: str) -> Iterator[str]:
    yield from (f"{heading} {name}", "", escape(command.description or ""), "")
    usage = command.format_usage().removeprefix("usage: ").replace("\n       ", "\n").rstrip()
    yield from ("```text", usage, "```", "")
    for action in command._actions:
        if not isinstance(action, _SubParsersAction) and action.dest != "help":
            yield from _describe_argument(command, action)
    if command.epilog:
        yield from ("```text", command.epilog, "```", "")
    for verb, inner in _subparsers(command):
        yield from _describe(f"{name} {verb}", inner, heading + "#")


def _describe_argument(command: ArgumentParser, action: Action) -> Iterator[str]:
    """One item of a definition list."""
    formatter = command._get_formatter()
    given = formatter._format_action_invocation(action)
    yield from (f"`{given}`", f": {escape(formatter._expand_help(action) if action.help else '')}", "")
