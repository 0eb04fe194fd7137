"""--without: names of landmarks and faces are checked before a run begins, in the locale that they tell."""

from __future__ import annotations

import pytest

from harvey.errors import BadInput
from harvey.replay.what_if import check_removals
from logs.run_head import load_known_world
from world_models.building.geometry.scene import LocaleGeometry
from world_models.files.toml.source import WORLDS
from world_models.frame_store import FrameStore


@pytest.fixture
def store() -> FrameStore:
    return FrameStore(load_known_world(WORLDS / "research_center.toml"))


def test_what_its_locale_has_is_found_without_reading_the_others(
    store: FrameStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read_all(_source: object) -> tuple[LocaleGeometry, ...]:
        raise AssertionError("expected one locale to be read, got all of them")

    monkeypatch.setattr(type(store.world), "parts", property(read_all))
    check_removals(["allens-office/desk", "allens-door", "hallway/pillar-1"], store, ["motor"])


@pytest.mark.parametrize(("name", "word"), [
    ("desk", "expected allens-office/desk, .* or as 'CameraPicture-88 segment 12', got 'desk'"),
    ("allens-office/deks", "allens-office/desk"),
    ("plan_adjustor", "expected plan_adjuster"),
    ("hallway", "hallway/"),
    ("xyzzy", r"expected a knowledge source \(plan_adjuster\), a landmark or a face"),
    ("", "expected"),
])
def test_what_is_not_there_is_answered_with_what_is(store: FrameStore, name: str, word: str) -> None:
    with pytest.raises(BadInput, match=word):
        check_removals([name], store, ["plan_adjuster"])
