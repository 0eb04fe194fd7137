"""``harvey completion``: what a shell needs to complete the command line, made from the parsers by shtab."""

from __future__ import annotations

from argparse import Action, ArgumentParser, Namespace, _SubParsersAction
from collections.abc import Iterator, Mapping, Sequence

from harvey.commands.command import Command

SHELLS = ("bash", "zsh")
NAMED: Mapping[str, str] = {"scenario": "_harvey_scenarios", "experiment": "_harvey_experiments"}
"""By the name of an argument: the shell function that completes it."""
FUNCTION: Mapping[str, str] = {
    "bash": '{name}() {{ compgen -W "{words}" -- "$1"; compgen -f -- "$1"; }}',
    "zsh": "{name}() {{ compadd -- {words}; _files }}",
}
"""Completes some words, or a file."""


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("shell", metavar="SHELL", choices=SHELLS, help=" or ".join(SHELLS))


def _run(args: Namespace) -> int:
    import shtab

    from experiments import list_names
    from harvey.cli import parser
    from sim.scenario_names import list_scenarios

    top = parser()
    for action in _list_actions(top):
        if action.dest in NAMED:
            action.complete = dict.fromkeys(SHELLS, NAMED[action.dest])  # type: ignore[attr-defined]
        elif action.choices is None and action.nargs != 0:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
    words: Mapping[str, Sequence[str]] = {"scenario": list_scenarios(), "experiment": list_names()}
    functions = [FUNCTION[args.shell].format(name=name, words=" ".join(words[what])) for what, name in NAMED.items()]
    print(shtab.complete(top, args.shell, preamble="\n".join(functions)))
    return 0


def _list_actions(parser: ArgumentParser) -> Iterator[Action]:
    """The arguments of a parser and of the parsers of its commands."""
    for action in parser._actions:
        if isinstance(action, _SubParsersAction):
            for inner in {id(one): one for one in action.choices.values()}.values():
                yield from _list_actions(inner)
        else:
            yield action


COMMAND = Command(
    "completion", "print what bash or zsh needs to complete commands, options, scenarios and files",
    (
        ("source <(harvey completion bash)", "in this shell, and in every one from ~/.bashrc"),
        ("harvey completion zsh > ~/.zfunc/_harvey", "for zsh, where ~/.zfunc is in fpath"),
    ),
    _arguments, _run,
)
