"""What the recorder says in words: sentences, levels, the tree's labels and the story."""

from blackboard import Blackboard, Decision, Post, Ref, Retracted, View
from logs.recording.loggers.decisions import COLUMNS, Messages, log_level, row, sentence
from logs.recording.loggers.lanes import activity
from logs.recording.loggers.plan import NO_SKETCH, outline
from logs.recording.loggers.why_panel import THOUGHTS, compose
from logs.timeline import Mirror
from scripted_mission import play
from world_models.entries import BodyFault, Hypothesis, Leg, MotorCommand, Recovery
from world_models.words import grouped
from world_models.words import sentence as words_of


def play_to(until: str = "") -> tuple[list[Decision], Mirror]:
    """The decisions and the mirror after the one that made the entry ``until``, or after all."""
    decisions: list[Decision] = []
    play([decisions.append])
    mirror = Mirror()
    for decision in decisions:
        for change in (*decision.observed, *decision.made):
            mirror.take(change)
        if until in {str(change.entry.ref) for change in decision.made}:
            break
    return decisions, mirror


def test_a_decision_is_told_in_a_sentence() -> None:
    messages = Messages()
    told = "\n".join(sentence(d, messages) for d in play_to()[0])
    assert ("sketcher: plan sketch from locale to locale: M0 of its milestones M0 to M2 is still to be verified; "
            "plan sketch through kitchen: M0 of its milestones M0 to M1 is still to be verified") in told
    assert ("motor: straight leg of 2.24 m, moving after 0 increments; "
            "turn 22.9 degrees left and move 0.60 m ahead") in told
    assert "tracker: the belief moves by 0.58 m and 22.9 degrees, by tracks; " in told
    assert "[the wheels claim: turn 22.9 degrees left and move 0.60 m ahead; picture of" in told
    assert "judge: verified: 2 of 2 lines; " in told
    assert "clumsy: refused, RuntimeError: fell over its own feet" in told
    assert "nobody had anything to do" in told


def test_what_happened_several_times_in_a_row_is_told_once() -> None:
    assert grouped(["a", "a", "b", "a"]) == ["a (2 times)", "b", "a"]


def test_a_change_is_told_by_the_first_clause_of_the_entrys_own_sentence() -> None:
    """One vocabulary: the recording and ``why`` say the same; the recording has room for less of it."""
    messages = Messages()
    kinds = set()
    for decision in play_to()[0]:
        for change in decision.made:
            said, value = messages.message(change), change.entry.value
            if said and not isinstance(value, Hypothesis) and not isinstance(change, Retracted):
                kinds.add(type(value).__name__)
                assert words_of(value).startswith(said) and ";" not in said
    assert {"PoseFix", "Certificate", "MotorCommand", "PlanSketch", "Discrepancy"} <= kinds


def faulty(status: str) -> Mirror:
    mirror, board = play_to("MotorCommand-1.0")[1], Blackboard()
    fault = BodyFault("camera", "camera unplugged", "no picture for 2.0 s", "PictureRequest-3", 12.0, status=status)
    for change in board.apply([Post(fault), Post(Recovery("BodyFault-1", "PictureRequest-3", 12.0, 0.5, tries=1))],
                              author="body", cycle=20):
        mirror.take(change)
    return mirror


def thoughts(board: View) -> str:
    return compose({title: tell(board) for title, (tell, *_) in THOUGHTS.items()})


def test_a_fault_of_the_body_is_the_headline() -> None:
    told = thoughts(faulty("open"))
    assert told.startswith("### Trouble: camera unplugged")
    assert "**Trouble:** the camera is at fault since 12.0 s into the run: camera unplugged" in told
    assert "It waits 0.50 s and tries again; to have PictureRequest-3 answered, 1 try so far." in told
    assert activity(faulty("open"))[0] == "is in trouble"
    assert "Trouble" not in thoughts(faulty("over"))


def test_trouble_stands_out() -> None:
    levels = {d.chosen.source.name: log_level(d) for d in play_to()[0] if d.chosen}
    assert levels["clumsy"] == "ERROR"
    assert levels["tracker"] == "WARN"
    assert levels["motor"] == levels["sketcher"] == "INFO"


def test_the_table_has_its_columns_in_every_cycle() -> None:
    assert all(tuple(row(d)) == COLUMNS for d in play_to()[0])


def test_the_tree_is_an_outline_with_the_sketch_under_its_subgoal() -> None:
    nodes = outline(play_to("Certificate-1.0")[1])
    assert [(n.depth, n.label) for n in nodes] == [
        (0, "Goal-1: be in parlour (active)"),
        (1, "· M0"),
        (1, "to parlour by kitchen-door"),
        (2, "✔ M0"),
        (2, "straight to (3.0, 2.0) m"),
        (2, "· M1"),
        (1, "· M1"),
        (1, "straight to (2.0, 2.0) m"),
        (1, "· M2"),
    ]


def test_a_goal_without_a_sketch_says_so() -> None:
    assert [n.label for n in outline(play_to("Goal-1.0")[1])] == ["Goal-1: be in parlour (active)", NO_SKETCH]


def test_the_tree_of_nothing_is_empty() -> None:
    assert outline(Mirror()) == []


def test_the_story_says_what_it_wants_expects_sees_doubts_and_does() -> None:
    told = thoughts(play_to("PoseFix-1.0")[1])
    assert told.startswith("### Looking for a milestone")
    assert "**Goal:** from kitchen (1.00, 1.00) m to parlour (2.00, 2.00) m; active." in told
    assert ("**It believes** that it stands at (1.00, 1.00) m of kitchen, heading 0.0 degrees "
            "(within 20 mm and 0.6 degrees, one sigma; protection level 83 mm), by command.") in told
    assert "**Milestone** the door is expected; " in told and "should show 2 model lines of kitchen-door." in told
    assert "**It sees** 3 line segments found; 2 segments paired with model lines; 1 of 2" in told
    assert "**It doubts:** nothing now." in told


def test_the_story_tells_of_a_discrepancy_and_of_being_lost() -> None:
    told = thoughts(play_to("Discrepancy-2.0")[1])
    assert "**It doubts:** the door is not where it was expected: not yet measured there." in told
    assert told.startswith("### In doubt: checking where it is before it goes on")
    assert "**It does:** has halted on a straight leg of 2.24 m" in told
    assert "**It last judged** milestone the door was verified: 2 of 2 lines" in told
    lost = thoughts(play_to()[1])
    assert lost.startswith("### The end: reached\n\n**The mission ended:** reached, because there.")
    assert "it is lost" in lost


def test_an_order_is_told_with_the_clause_that_why_has_for_it() -> None:
    mirror, board = Mirror(), Blackboard()
    leg = Leg("PlanSketch-1", 0, 0.0, 0.0, 1.0, 0.0, 0.1, aim_rad=0.1)
    for effect in (Post(leg), Post(MotorCommand(0.1, 0.0), (Ref("Leg-1", 0),))):
        mirror.take(*board.apply([effect], author="motor", cycle=1))
    because = "because the line to follow lay 5.7 degrees left of where it believed that it faced"
    assert f"**Last order:** turn 5.7 degrees left, {because}." in thoughts(mirror)
