"""Why, on whole missions: every entry has a story, every decision its grounds, every source a reason not to act.

Two seeds of one mission across Allen's office, in which somebody bumps into Harvey.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from blackboard import registry_of
from experiments.scale.explanations import write_hour
from harvey.agent import Agent, build_agent
from harvey.cli import main
from harvey.replay.why_not_again import board_at, changes, in_cycle, why_absent
from knowledge_sources.methods.motion.clearance import LATENCY_S
from knowledge_sources.reads import FloorAhead, current_leg, find_belief
from logs.explain.diff import grounds, parting, same
from logs.explain.phrases import describe_decision
from logs.explain.web import check
from logs.explain.why import lines_of, story
from logs.run_head import RunHead
from logs.timeline import Timeline
from recorded_runs import Recorded
from world_models.entries import Hypothesis
from world_models.entries.entry_kinds import KINDS

KNOWN = registry_of((), KINDS)
MOTION = re.compile(
    r"Harvey was told to .+ because the line to follow lay .+ (left|right) of where it believed that it faced,"
    r" because in CameraPicture-\d+ .+ px (left|right|above|below).* its prediction at .+ \(Tracks-1\.\d+\),"
    r" made from pose Hypothesis-1\.\d+, made from match LineMatch-\d+ of segments? [\d, and]+.* in CameraPicture-\d+"
    r" against .+\.$"
)


@pytest.fixture(scope="module")
def runs(recorded: Recorded) -> tuple[Path, Path]:
    return recorded("bump").path, recorded("other bump").path


@pytest.fixture(scope="module")
def history(runs: tuple[Path, Path]) -> Timeline:
    return Timeline(runs[0] / "journal.jsonl")


@pytest.fixture(scope="module")
def agent(runs: tuple[Path, Path]) -> Agent:
    return build_agent(RunHead.read(runs[0]))


def test_every_decision_rests_on_something(runs: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    for run in runs:
        found = check(Timeline(run / "journal.jsonl"))
        assert found.reached == found.decisions > 50
        assert main(["why", str(run), "--check"]) == 0
        assert f"{found.decisions} of {found.decisions} decisions rest on something" in capsys.readouterr().out


def test_every_entry_has_a_story_that_tells_each_thing_once_and_names_its_sources(history: Timeline) -> None:
    for ref in history.refs:
        record = history.entry(ref)
        assert record is not None
        told = story(history, record)
        texts = [step.text for step in told.steps]
        assert len(set(texts)) == len(texts)
        assert all(history.entry(name) is not None for step in told.steps for name in step.refs)
        if record.type not in ("Command", "CameraState", "Wheels", "Footprint"):
            assert "command" in {step.label for step in told.steps}
        assert not re.search(r"\bnan\b|\binf\b|None", "\n".join(lines_of(told)))


def test_a_motion_is_told_in_one_sentence_down_to_segments_and_model(history: Timeline) -> None:
    motions = [r for ref in history.refs if ref.startswith("MotorCommand") and (r := history.entry(ref))]
    heads = [story(history, r).headline for r in motions]
    assert all(" because " in head for head in heads)
    tracked = [h for h in heads if "(Tracks-" in h]
    assert len(tracked) >= 5
    assert [h for h in tracked if "line to follow" in h and "match" in h and not MOTION.match(h)] == []
    assert sum(MOTION.match(h) is not None for h in tracked) >= 2


def test_the_time_that_is_told_is_the_newest_that_was_observed(history: Timeline) -> None:
    """Also where a decision rests on an older picture than the last."""
    now, told = None, 0
    for decision in history.decisions():
        times = [r.fields["sim_time_s"] for r in decision.observed if r.type in ("CameraPicture", "MotionReport")]
        now = times[-1] if times else now
        for made in decision.made if now is not None else ():
            assert f", {now:.1f} s into the run," in describe_decision(history, made)
            told += 1
    assert told > 100


def test_the_numbers_of_a_story_are_those_of_the_entries(history: Timeline) -> None:
    for ref in (ref for ref in history.refs if ref.startswith("Leg-")):
        leg = history.entry(ref)
        belief = None if leg is None else history.reason(leg, Hypothesis)
        sketch = None if leg is None else history.entry(history.newest[leg.fields["sketch"]])
        if leg is None or belief is None or sketch is None or leg.fields["to_go_m"] is None:
            continue
        goal, here = sketch.fields["subgoals"][leg.fields["index"]]["destination"], belief.fields["locale_from_robot"]
        if goal["locale"] == belief.fields["locale"]:
            away = ((goal["x_m"] - here["x_m"]) ** 2 + (goal["y_m"] - here["y_m"]) ** 2) ** 0.5
            assert away**2 == pytest.approx(leg.fields["to_go_m"] ** 2 + leg.fields["left_m"] ** 2, abs=1e-6)


def test_who_is_not_named_could_not_act_and_who_is_says_so_again(
    history: Timeline, agent: Agent
) -> None:
    """The journal and the sources, asked again on a board that is built from it, agree in every cycle."""
    asked = 0
    for cycle in history.cycles:
        board, decision = board_at(history, cycle, KNOWN, agent.store), history.decision(cycle)
        ratings = {(c.source, c.trigger): c.rating for c in decision.activated}
        for source in agent.sources:
            for change in changes(history, cycle, KNOWN, agent.store):
                key = (source.name, str(change.entry.ref))
                if any(watch.sees(change) for watch in source.on) and board.view.is_current(change.entry):
                    case = source.find_case(board.view, change)
                    assert (None if case is None else source.rate(case)) == ratings.get(key)
                    asked += 1
        absent = [e for e in agent.sources if not in_cycle(history, e.name, cycle)]
        for source in absent[:: len(absent) // 2 or 1]:
            assert "could have acted" not in "\n".join(why_absent(history, source, cycle, KNOWN, agent.store))
    assert asked > 100


def test_a_watch_whose_condition_did_not_hold_is_told_as_that(
    runs: tuple[Path, Path], history: Timeline, capsys: pytest.CaptureFixture[str]
) -> None:
    """The probe photographer watches for beliefs moved by odometry; one that rests on landmarks does not wake it."""
    beliefs = ((d.cycle, history.entry(ref)) for d in history.decisions() for ref in d.seen
               if ref.startswith("Hypothesis-1."))
    cycle, ref = next((cycle, r.ref) for cycle, r in beliefs
                      if r is not None and r.change == "Revised" and r.fields["basis"] == "tracks")
    assert main(["why", str(runs[0]), "--not", "probe_photographer", "--at", str(cycle)]) == 0
    told = capsys.readouterr().out
    assert f"came what the probe photographer watches for, {ref} revised, " in told and "has a condition" in told
    assert "Nothing that" not in told


def test_two_seeds_part_at_an_observation_and_each_later_difference_goes_back_to_one(
    runs: tuple[Path, Path], history: Timeline, capsys: pytest.CaptureFixture[str]
) -> None:
    theirs = Timeline(runs[1] / "journal.jsonl")
    assert main(["diff", str(runs[0]), str(runs[1])]) == 1
    out = capsys.readouterr().out
    where = parting(history, theirs, 0)
    first = history.entry(where.observation)
    assert first is not None and first.observed
    assert all(same(history.entry(r.ref), theirs.entry(r.ref))
               for d in history.decisions() if d.cycle < first.cycle for r in (*d.observed, *d.made))
    assert f"The first observation that differs is {where.observation}, in cycle {first.cycle}" in out
    assert f"The first motion that differs is {where.motion}" in out
    chain = list(grounds(history, theirs, where.motion))
    assert chain[-1][0].observed
    assert chain[-1][0].ref == where.observation
    assert "seed: 0 against 1" in out


def test_the_same_run_does_not_differ(runs: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["diff", str(runs[0]), str(runs[0])]) == 0
    assert "agree in all" in capsys.readouterr().out


def test_a_run_told_over_and_over_is_a_journal_too(runs: tuple[Path, Path], history: Timeline, tmp_path: Path) -> None:
    write_hour(runs[0] / "journal.jsonl", tmp_path / "journal.jsonl", cycles=3 * len(history.cycles))
    longer = Timeline(tmp_path / "journal.jsonl")
    assert longer.cycles == tuple(range(1, 3 * len(history.cycles) + 1))
    assert len(longer.refs) == len(set(longer.refs)) == 3 * len(history.refs)
    found = check(longer)
    assert found.reached == found.decisions == len(longer.cycles)
    for k in (1, 2):
        cycle = history.cycles[-1] * k + 40
        assert len(longer.candidates(cycle)) == len(history.candidates(40))


def test_an_answer_needs_none_of_the_heavy_libraries(runs: tuple[Path, Path]) -> None:
    """An explanation starts fast only where nothing is imported that it does not use; entries hold numpy arrays."""
    code = f"import sys; from harvey.cli import main; main(['why', {str(runs[0])!r}]); print(sorted(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    loaded = set(re.findall(r"'(\w+)'", done.stdout.splitlines()[-1]))
    assert loaded & {"scipy", "cv2", "numba", "rerun", "shapely", "networkx"} == set()


def test_every_move_bears_the_harm_of_each_touch_that_the_map_of_its_cycle_leaves_possible(
    history: Timeline, agent: Agent
) -> None:
    """At its speed on the move; behind its end after braking: the robot can stop within its clearance."""
    moves, borne, wheels = 0, agent.settings.action.creep_speed_m_per_s, agent.robot.actuator
    for decision in history.decisions():
        commands = [m.fields for m in decision.made if m.type == "MotorCommand" and m.fields["move_m"] > 0.0]
        for command in commands:
            view = board_at(history, decision.cycle, KNOWN, agent.store).view
            (leg, *_), belief = current_leg(view) or (None,), find_belief(view)
            assert leg is not None and belief is not None
            clearance = FloorAhead(view, leg.value, belief, agent.settings).measure_clearance(1.5)
            speed, move_m = command["speed_m_per_s"] or wheels.speed_m_per_s, wheels.reach * command["move_m"]
            stops_m = np.maximum(clearance.at_m - LATENCY_S * speed, 0.0) * (clearance.at_m > move_m - 0.01)
            met = np.maximum(speed**2 - 2.0 * wheels.brake_m_per_s2 * stops_m, 0.0)
            assert (clearance.p * met <= borne**2 + 1e-4).all() and move_m <= clearance.room_m + 0.01
            moves += 1
    assert moves > 5
