"""The reference of the command line, from the parsers themselves."""

from __future__ import annotations

from argparse import Action, ArgumentParser, _SubParsersAction
from collections.abc import Iterator
from textwrap import wrap

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
    yield from ("```text", *_usage(name, command), "```", "")
    listed = [action for action in command._actions
              if not isinstance(action, _SubParsersAction) and action.dest != "help"]
    for action in listed:
        yield f"- `{_given(action)}`: {escape(_what(command, action))}"
    yield from ("",) if listed else ()
    if command.epilog:
        yield from ("```text", command.epilog, "```", "")
    for verb, inner in _subparsers(command):
        yield from _describe(f"{name} {verb}", inner, heading + "#")


def _usage(name: str, command: ArgumentParser) -> list[str]:
    """How it is called: made here, as argparse's own differs between versions of Python."""
    parts = [name]
    for action in command._actions:
        if isinstance(action, _SubParsersAction):
            parts.append("VERB ...")
        elif action.option_strings and action.dest != "help":
            parts.append(_given(action) if action.required else f"[{_given(action)}]")
    parts += [_metavar(action) for action in command._actions
              if not action.option_strings and not isinstance(action, _SubParsersAction)]
    together = " ".join(part.replace(" ", "\0") for part in parts)
    return [line.replace("\0", " ") for line in wrap(together, 100, subsequent_indent="    ", break_on_hyphens=False)]


def _given(action: Action) -> str:
    if not action.option_strings:
        return _metavar(action)
    value = "" if action.nargs == 0 else f" {_metavar(action)}"
    return f"{', '.join(action.option_strings)}{value}"


def _metavar(action: Action) -> str:
    shown = action.metavar or (f"{{{','.join(map(str, action.choices))}}}" if action.choices else action.dest.upper())
    name = " ".join(shown) if isinstance(shown, tuple) else shown
    return {"?": f"[{name}]", "*": f"[{name} ...]", "+": f"{name} [{name} ...]"}.get(str(action.nargs), name)


def _what(command: ArgumentParser, action: Action) -> str:
    return command._get_formatter()._expand_help(action) if action.help else ""
