"""What anything that is added by an entry point must keep: each check takes an implementation, whoever wrote it."""

from __future__ import annotations

import shlex
from argparse import ArgumentParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from box_rooms import box_room
from fake_cases import fake_cases, work_on
from harvey.campaign.workers import CaseAnswer, ClusterWorkers, Killed
from harvey.commands.command import CliCommand, add_parser
from harvey.errors import BadInput
from sim.render.lighting import Lighting
from sim.render.lights import LitRenderers, Room
from sim.render.renderer import Renderer
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2


def install(folder: Path, monkeypatch: pytest.MonkeyPatch, name: str, module: str, entry_points: str) -> None:
    """A package of one module, as pip leaves it: the module, and its metadata beside it."""
    (folder / f"{name}.py").write_text(module, encoding="utf-8")
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n", encoding="utf-8")
    (info / "entry_points.txt").write_text(entry_points, encoding="utf-8")
    monkeypatch.syspath_prepend(folder)


def check_command(command: CliCommand, of: str = "") -> None:
    """A command, or a verb of the command ``of``: it says what it is for, and its examples are parsed."""
    words = ["harvey", *of.split(), command.name]
    parser = ArgumentParser(prog=" ".join(words[:-1]), exit_on_error=False)
    add_parser(parser.add_subparsers(required=True), command)
    assert command.summary and command.summary[0].islower() and not command.summary.endswith(".")
    own = [shlex.split(line.partition("|")[0]) for line, what in command.examples if what]
    own = [given for given in own if given[:len(words)] == words]
    assert own, command.examples
    for given in own:
        _, unknown = parser.parse_known_args(given[len(words) - 1:])
        assert command.open_ended or not unknown, given


def check_cluster(workers: ClusterWorkers, cluster: str, folder: Path) -> None:
    """Workers of a cluster: each case is answered once, whoever is killed; only what kills its workers is given up."""
    cases, told = fake_cases(folder, [0, 9, 1, 0]), list[str]()
    found = list(workers.map_on_cluster(work_on, cases, cluster, told.append))
    answers = {place: answer.value.square for place, answer in found if isinstance(answer, CaseAnswer)}
    assert answers == {place: place * place / 3.0 for place in (0, 2, 3)}
    assert [place for place, answer in found if isinstance(answer, Killed)] == [1] and len(found) == len(cases)
    assert len(told) == 1
    with pytest.raises(ZeroDivisionError):
        list(workers.map_on_cluster(divide, [1.0, 0.0], cluster))
    with pytest.raises(BadInput, match="--cluster"):
        list(workers.map_on_cluster(divide, [1.0], "nowhere"))
    command = workers.worker_command("tcp://host:8786", 3)
    assert command[0] == "-m" and {"tcp://host:8786", "3"} <= set(command)


def divide(case: float) -> float:
    return 1.0 / case


def check_lit_renderers(renderers: LitRenderers) -> None:
    """Renderers of light: even light is as the core draws it, lamps add to it, and it comes out the same again."""
    room = Room(np.array([(0.0, 0.0), (6.0, 0.0), (6.0, 4.0), (0.0, 4.0)]), 0.0, 2.6)
    pose = CameraMount(1.0, 0.1).camera_from_robot @ Pose2(1.0, 1.0, 0.4).lifted().inverse()
    camera = Camera.from_field_of_view(1.1, 96, 80)

    def see(**light: Any) -> NDArray[np.float32]:
        lighting = Lighting(**{"lamps": 0.0, "bounces": 1, "rays": 16, **light})
        renderers.check(lighting)
        return renderers.build(box_room(), lighting, [room], 4).radiance(camera, pose)

    dark, even, lit, brighter = see(), see(flat=1.0), see(lamps=0.4), see(lamps=0.8)
    for picture in (dark, even, lit, brighter):
        assert picture.shape == (80, 96, 3) and picture.dtype == np.float32 and np.isfinite(picture).all()
    np.testing.assert_allclose(even, Renderer.of_faces(box_room(), 4).radiance(camera, pose), atol=1.0 / 1024)
    assert not dark.any() and not see(lamps=0.8, lamps_off=1.0).any()
    assert np.all(brighter >= lit) and brighter.mean() > 1.2 * lit.mean() > 0.0
    assert np.array_equal(see(lamps=0.4), lit)
