"""Laws of the recorder, for any input."""

import json
import math
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Blackboard, Decision, Effect, Level, Post, Retract, Revise, decision_record
from journals import read_journal
from logs.journal_file import JournalFile
from logs.recording.loggers.plan import outline
from logs.recording.loggers.robots import SIGMA_SCALE, ring
from logs.timeline import Mirror
from strategies import Note, Tally
from world_models.entries import Goal, Place, PlanSketch, Subgoal
from world_models.frames import Pose2

KINDS = st.sampled_from([Note, Tally])


@settings(deadline=None, max_examples=60)
@given(st.lists(st.tuples(st.sampled_from(["post", "revise", "retract"]), st.integers(0, 5), KINDS), max_size=30))
def test_the_mirror_shows_what_the_board_holds(actions: list[tuple[str, int, type]]) -> None:
    board, mirror = Blackboard(), Mirror()
    for action, number, kind in actions:
        known = board.view.all(kind)
        value = Note(str(number)) if kind is Note else Tally(number)
        effect: Effect = Post(value)
        if known and action != "post":
            entry = known[number % len(known)]
            effect = Revise(entry, value) if action == "revise" else Retract(entry)
        for change in board.apply([effect], author="x", cycle=1):
            mirror.take(change)
    for kind in (Note, Tally):
        assert mirror.all(kind) == board.view.all(kind)
        assert mirror.latest(kind) == board.view.latest(kind)


@settings(deadline=None, max_examples=40)
@given(st.lists(st.text(max_size=40), max_size=6))
def test_any_words_come_back_from_the_journal(words: list[str]) -> None:
    board = Blackboard()
    decisions = []
    for cycle, text in enumerate(words, 1):
        made = board.apply([Post(Note(text))], author="x", cycle=cycle)
        decisions.append(Decision(cycle, (), made, Level.ACTION, (), (), None, None, 0, made, text))
    with TemporaryDirectory() as folder:
        path = Path(folder) / "journal.jsonl"
        journal = JournalFile(path)
        for decision in decisions:
            journal(decision)
        journal.close()
        assert list(read_journal(path)) == [json.loads(json.dumps(decision_record(d))) for d in decisions]


@settings(deadline=None, max_examples=60)
@given(st.lists(st.tuples(st.lists(st.integers(0, 2), max_size=2), st.integers(0, 3),
                          st.sampled_from(["active", "done", "superseded"])), max_size=8))
def test_the_tree_hangs_together(sketches: list[tuple[list[int], int, str]]) -> None:
    """Node names are unique, and each node but the first hangs on one above it."""
    board, mirror = Blackboard(), Mirror()
    place = Place("here", 0.0, 0.0)
    step = Subgoal(place, place, True)
    drawn = [Post(PlanSketch("Goal-1", tuple(path), "here", (step,) * 3, at=at, status=status))
             for path, at, status in sketches]
    for change in board.apply([Post(Goal(place, place)), *drawn], author="x", cycle=1):
        mirror.take(change)
    nodes = outline(mirror)
    names = [node.id for node in nodes]
    assert len(set(names)) == len(names)
    assert nodes[0].after == ""
    for number, node in enumerate(nodes[1:], 1):
        assert node.after in names[:number]


@settings(deadline=None, max_examples=60)
@given(st.floats(-math.pi, math.pi), st.floats(-math.pi, math.pi), st.floats(0.001, 0.3), st.floats(0.001, 0.3))
def test_the_ellipse_is_one_sigma_scaled(heading: float, axis: float, long_m: float, short_m: float) -> None:
    """Every point of the ring, turned back into the world, lies at the Mahalanobis distance of the scale."""
    c, s = math.cos(axis), math.sin(axis)
    turn = np.array([[c, -s], [s, c]])
    covariance = np.zeros((3, 3))
    covariance[:2, :2] = turn @ np.diag([long_m**2, short_m**2]) @ turn.T
    points = ring(Pose2(3.0, -2.0, heading), covariance)
    world_from_robot = Pose2(0.0, 0.0, heading).lifted()
    offsets = world_from_robot.apply(np.column_stack([points, np.zeros(len(points))]))[:, :2]
    distance = np.sqrt(np.einsum("ni,ij,nj->n", offsets, np.linalg.inv(covariance[:2, :2]), offsets))
    assert np.allclose(distance, SIGMA_SCALE, rtol=1e-5)
