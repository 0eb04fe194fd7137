"""``harvey list``: what there is to run."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from textwrap import fill

from harvey.commands.command import Command


def _arguments(_parser: ArgumentParser) -> None:
    pass


def _run(_args: Namespace) -> int:
    import experiments
    from sim.scenario_names import describe_scenario, list_scenarios

    print("scenarios (harvey run NAME):")
    for name in list_scenarios():
        print(_item(name, describe_scenario(name)))
    for folder, group in experiments.EXPERIMENTS.items():
        print(f"\nexperiments: {folder} (harvey experiment NAME):")
        for name, summary in sorted(group.items()):
            print(_item(name, summary))
    print("\nA seed fixes noise and chance: the same scenario and seed give the same run. Without --seed it is 0;"
          "\n--seed 0..19 runs twenty. A mission of your own is a TOML file like those in sim/scenarios/.")
    return 0


def _item(name: str, text: str) -> str:
    return fill(text, 112, initial_indent=f"  {name:<22} ", subsequent_indent=" " * 25)


COMMAND = Command(
    "list", "what there is to run: scenarios and experiments",
    (("harvey list", "names and descriptions"),), _arguments, _run,
)
