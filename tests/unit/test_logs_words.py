"""What the diary says in words: sentences, levels, the tree's labels and the story."""

from blackboard.journal import Decision
from logs.loggers.decisions import COLUMNS, log_level, row, sentence
from logs.loggers.sketch_tree import outline
from logs.loggers.why import story
from logs.mirror import Mirror
from rehearsal import play


def played(until: str = "") -> tuple[list[Decision], Mirror]:
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
    sentences = [sentence(d) for d in played()[0]]
    did = "revised Hypothesis-1.1, posted Tracks-1.0, posted Discrepancy-1.0"
    assert f"tracker (rating 0.50) on Cue-7.0: {did}" in sentences
    assert "sketcher (rating 0.50) on Cue-2.0: posted 2 x PlanSketch" in sentences
    assert "clumsy (rating 0.50) on Cue-9.0: refused, RuntimeError: fell over its own feet" in sentences
    assert "nobody acted" in sentences


def test_trouble_stands_out() -> None:
    levels = {d.chosen.source.name: log_level(d) for d in played()[0] if d.chosen}
    assert levels["clumsy"] == "ERROR"
    assert levels["tracker"] == "WARN"
    assert levels["motor"] == levels["sketcher"] == "INFO"


def test_the_table_has_its_columns_in_every_cycle() -> None:
    assert all(tuple(row(d)) == COLUMNS for d in played()[0])


def test_the_tree_is_an_outline_with_the_sketch_under_its_subgoal() -> None:
    nodes = outline(played("Certificate-1.0")[1])
    assert [(n.depth, n.label) for n in nodes] == [
        (0, "Goal-1: kitchen → parlour, active"),
        (1, "· M0"),
        (1, "to parlour by kitchen-door"),
        (2, "✔ M0"),
        (2, "go to (3.0, 2.0) m"),
        (2, "· M1"),
        (1, "· M1"),
        (1, "go to (2.0, 2.0) m"),
        (1, "· M2"),
    ]


def test_the_tree_of_nothing_is_empty() -> None:
    assert outline(Mirror()) == []


def test_the_story_says_what_he_wants_expects_sees_doubts_and_does() -> None:
    told = story(played("PoseFix-1.0")[1])
    assert "**Harvey wants** to go from (kitchen (1.00, 1.00) m) to (parlour (2.00, 2.00) m) (active)." in told
    assert "**He believes** he is in kitchen at (1.00, 1.00) m, heading 0.0°, give or take 20 mm and 0.57°" in told
    assert "**He expects** the door: 2 lines of kitchen-door." in told
    assert "**He sees** 3 line segments, 2 matched, 1 of these agree on one pose." in told
    assert "**He doubts:** nothing at the moment." in told


def test_the_story_tells_of_a_discrepancy_and_of_being_lost() -> None:
    told = story(played("Discrepancy-2.0")[1])
    assert "the door is not where it was expected: not yet measured (at the plan level" in told
    assert "He does:** has halted on a straight leg of 2.2 m" in told
    assert "TURN +22.9°, MOVE 0.60 m because of Leg-1.0 ← PlanSketch-2.1." in told
    lost = story(played()[1])
    assert lost.startswith("**The end:** reached: there")
    assert "he is lost" in lost
