"""Every sign that a recording shows is one that the viewer's fonts have: any other ends a viewer without a window."""

from __future__ import annotations

from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st
from rerun.chunk import RrdReader

from blackboard import Blackboard, Decision, Effect, Level, Post, Sink
from logs.recording.paths import RECORDS
from logs.recording.stream import REFUTED, SIGNS, TROUBLE, VERIFIED, viewable
from logs.recording.writer import RecordingWriter
from scripted_mission import CAMERA, HOUSE, MOUNT, play
from world_models.entries import BodyFault, Discrepancy, Goal, Milestone, Outcome, Place, PlanSketch, Subgoal
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world

ODD = "\u65e5\u672c ✘ ❌ ﬁ 😀 é"
"""A text of a user, with signs that the fonts lack."""


ODD_HOUSE = HOUSE.replace("[doors]", f'[locales."{ODD}"]\nkind = "room"\nat = [0, 4.2]\nsize = [4, 4]\n[doors]')


def texts_in(path: Path) -> set[str]:
    """Everything in a recording that is text, but for the decisions' lines, which programs read."""
    found: set[str] = set()
    for chunk in RrdReader(path).stream():
        if chunk.entity_path == f"/{RECORDS}":
            continue
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            for cell in batch.column(name).to_pylist():
                found |= {text for text in (cell if isinstance(cell, list) else [cell]) if isinstance(text, str)}
    return found


def refuted(sink: Sink) -> None:
    """Entries of which each word is a user's, and a milestone of each status."""
    board, place = Blackboard(), Place(ODD, 0.0, 0.0)
    effects: list[Effect] = [Post(Goal(place, place)),
                             Post(PlanSketch("Goal-1", (), ODD, (Subgoal(place, place, True, ODD),) * 4))]
    effects += [Post(Milestone("PlanSketch-1", number, f"M{number} of {ODD}", 0.0, (ODD,), status=status))
                for number, status in enumerate(("turning", "expected", "verified", "refuted", "not testable"))]
    effects += [Post(BodyFault("camera", ODD, ODD, "PictureRequest-1", 1.0)), Post(Outcome("lost", ODD)),
                Post(Discrepancy(Level.PLAN, ODD, None, (1.0, 2.0), "px"))]
    made = board.apply(effects, author="sketcher", cycle=1)
    sink(Decision(1, (), made, Level.ACTION, (), (), None, None, 0, (), ""))


def test_a_recording_shows_only_signs_that_the_viewer_has(tmp_path: Path) -> None:
    path = tmp_path / "recording.rrd"
    world = read_world(Source.parse(ODD_HOUSE, "house.toml"))
    recorder = RecordingWriter(path, world=world, camera=CAMERA, mount=MOUNT, title=ODD, recording_id="signs")
    refuted(recorder)
    play([lambda decision: recorder(decision._replace(cycle=decision.cycle + 1))])
    recorder.close()
    texts = texts_in(path)
    assert {VERIFIED, REFUTED, TROUBLE} <= {sign for text in texts for sign in text}
    assert {text for text in texts if not SIGNS.issuperset(text)} == set()


@settings(deadline=None, max_examples=200)
@given(st.text())
def test_a_viewable_text_is_as_long_and_the_same_where_it_can_be(text: str) -> None:
    shown = viewable(text)
    assert len(shown) == len(text) and viewable(shown) == shown
    for sign, instead in zip(text, shown, strict=True):
        assert instead == (sign if sign in SIGNS or text.isascii() else "?")
