"""Commands that other packages add; and those of extras that are not installed say what to install."""

from __future__ import annotations

from pathlib import Path

import pytest

from harvey.cli import main
from harvey.commands import MODULES, find_added_commands, find_commands
from seams import check_command, install
from world_models import plugins

MODULE = '''
from harvey.commands.command import CliCommand

def say(args):
    print("hello", args.name)
    return 1

HELLO = CliCommand("hello", "say hello", (("harvey hello you", "to you"),), lambda p: p.add_argument("name"), say)
'''


@pytest.fixture
def hello(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An installed package with a command and a verb of ``world``."""
    install(tmp_path, monkeypatch, "hello_module", MODULE,
            "[harvey.commands]\nhello = hello_module:HELLO\nhouse.greet = hello_module:HELLO\n")


def test_a_command_of_another_package_is_one_of_ours(hello: None, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["hello", "you"]) == 1
    assert capsys.readouterr().out == "hello you\n"
    assert main(["--help"]) == 0 and "say hello" in capsys.readouterr().out
    verb, = find_added_commands("house")
    assert verb.name == "greet" and "greet" not in {command.name for command in find_commands()}


def test_an_absent_extra_is_named_with_what_to_install(
        monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(plugins, "EXTRAS", {"harvey.commands": {"fly": "harvey-wings", "house.fly": "harvey-wings"}})
    assert main(["fly", "far", "--high"]) == 2
    assert capsys.readouterr().err == "harvey: fly needs harvey-wings: pip install ./extras/harvey-wings\n"
    assert main(["fly", "--help"]) == 0 and "pip install ./extras/harvey-wings" in capsys.readouterr().out
    assert [verb.summary for verb in find_added_commands("house")] == [
        "needs harvey-wings: pip install ./extras/harvey-wings"]


@pytest.mark.parametrize("name", MODULES)
def test_every_command_keeps_what_an_added_one_must(name: str) -> None:
    if name != "completion":  # its examples are of a shell
        command, = find_commands(name)
        check_command(command)
