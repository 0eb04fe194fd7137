"""The picture in ARCHITECTURE.md, made from the classes: ``python -m docs.tools.fill`` writes it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from xml.sax.saxutils import escape

from blackboard import KnowledgeSource, Level, Registry, Role

PICTURE = Path(__file__).parents[1] / "architecture.svg"
WIDTH, MARGIN, GAP = 1000, 16, 40
SIDE_WIDTH = 250
LINE, SMALL_LINE = 20, 18
BOARD_CHARACTERS = 46
"""Of a line of kinds on the board."""
NAMES = {"med_r_and_t": "Med-R-and-T"}
QUESTIONS = {
    Level.GOAL: ("Am I lost? Where could I be?", "a new goal, and so new sketches"),
    Level.PLAN: ("What should I see there? Do I?", "pose taken over, sketch adjusted"),
    Level.ACTION: ("Is each landmark where it should be?", "the next increment is steered"),
}
ROLES = {
    Role.REQUEST: "requests to the ports",
    Role.OBSERVATION: "observations",
    Role.INFERENCE: "inferences",
}
SCHEDULER = ("take up the changes; drop what no longer holds", "ask who could act, and how well",
             "choose: level in focus, then rating, then age", "one acts: all its effects, or none",
             "write the decision down", "only then ask the ports")
STYLE = """
    .room { fill: #ffffff; stroke: #35405a; stroke-width: 1.5 }
    .board { fill: #f3f5fa; stroke: #35405a; stroke-width: 3 }
    .goal { fill: #fbe3ea } .plan { fill: #fdeed8 } .action { fill: #deebfd }
    .line { stroke: #35405a; stroke-width: 1.5; fill: none }
    text { fill: #1d2438; text-anchor: middle }
    .small { font-size: 12px; fill: #4a5470 } .head { font-weight: bold } .left { text-anchor: start }
  """
HEAD = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" \
font-family="Helvetica, Arial, 'DejaVu Sans', sans-serif" font-size="14">
  <title>Harvey: knowledge sources of three servo levels round a blackboard; scheduler, run recorder, ports, \
simulator or robot, building model</title>
  <style>{style}</style>
  <defs><marker id="a" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="8" markerHeight="8" \
orient="auto-start-reverse">
    <path d="M0 0L10 5L0 10z" fill="#35405a"/></marker></defs>
  <rect width="{width}" height="{height}" fill="#fff"/>
"""

Line = tuple[str, str]
"""A style and a text."""


class Canvas:
    """Boxes, texts and arrows, as lines of SVG."""

    def __init__(self) -> None:
        self.elements: list[str] = []

    def box(self, style: str, x: int, y: int, width: int, height: int, lines: Sequence[Line]) -> None:
        """A box with lines of text in its middle."""
        self.elements.append(f'  <rect class="{style}" x="{x}" y="{y}" width="{width}" height="{height}" rx="8"/>')
        line_y = y + (height - sum(map(height_of, lines))) / 2
        for line in lines:
            line_y += height_of(line)
            self.text(line[0], x + width // 2, round(line_y) - 5, line[1])

    def text(self, style: str, x: int, y: int, text: str) -> None:
        name = f' class="{style}"' if style else ""
        self.elements.append(f'  <text{name} x="{x}" y="{y}">{escape(text)}</text>')

    def arrow(self, x0: int, y0: int, x1: int, y1: int, *, both: bool = True) -> None:
        start = ' marker-start="url(#a)"' if both else ""
        self.elements.append(f'  <path class="line" d="M{x0} {y0}L{x1} {y1}"{start} marker-end="url(#a)"/>')


def height_of(line: Line) -> int:
    """Of a line of text [px]; an empty one is a small gap."""
    return 8 if not line[1] else SMALL_LINE if "small" in line[0] else LINE


def draw_architecture(sources: Iterable[type[KnowledgeSource]], kinds: Registry) -> str:
    """The picture as SVG."""
    sources, canvas = tuple(sources), Canvas()
    board_x = MARGIN + SIDE_WIDTH + GAP
    board_width, right_x = WIDTH - 2 * board_x, WIDTH - MARGIN - SIDE_WIDTH
    middle, right_middle = WIDTH // 2, right_x + SIDE_WIDTH // 2

    goal, plan, action = (level_lines(level, sources) for level in (Level.GOAL, Level.PLAN, Level.ACTION))
    board = board_lines(kinds)
    goal_height, height = fit(goal), max(map(fit, (plan, action, board)))
    canvas.box("room goal", board_x, MARGIN, board_width, goal_height, goal)
    y = MARGIN + goal_height + GAP
    canvas.box("room plan", MARGIN, y, SIDE_WIDTH, height, plan)
    canvas.box("board", board_x, y, board_width, height, board)
    canvas.box("room action", right_x, y, SIDE_WIDTH, height, action)
    canvas.arrow(middle, y - GAP + 4, middle, y - 4)
    canvas.arrow(board_x - GAP + 4, y + height // 2, board_x - 4, y + height // 2)
    canvas.arrow(right_x - GAP + 4, y + height // 2, right_x - 4, y + height // 2)
    canvas.text("small left", middle + 12, y - GAP // 2 + 4, "changes wake knowledge sources; these ask for effects")

    below = y + height + GAP
    scheduler = [("head", "the scheduler, each cycle"), *(("small", text) for text in SCHEDULER)]
    scheduler_height = fit(scheduler)
    canvas.box("room", board_x, below, board_width, scheduler_height, scheduler)
    canvas.arrow(middle, below - GAP + 4, middle, below - 4)
    recorder = [("head", "the run recorder"), ("small", "journal, camera pictures, recording")]
    canvas.box("room", MARGIN, below + (scheduler_height - 64) // 2, SIDE_WIDTH, 64, recorder)
    center_y = below + scheduler_height // 2
    canvas.arrow(board_x - 4, center_y, board_x - GAP + 4, center_y, both=False)
    port = [("head", "the body's port"), ("small", "requests in, observations out")]
    canvas.box("room", right_x, below, SIDE_WIDTH, 64, port)
    canvas.arrow(right_x - GAP + 4, below + 32, right_x - 4, below + 32, both=False)
    canvas.arrow(right_x + 26, below - 4, right_x - GAP - 18, below - GAP + 4, both=False)
    canvas.text("small left", right_x + 36, below - GAP // 2 + 6, "what was observed")
    body = [("head", "simulator, or a robot"), ("small", "only here is the truth")]
    canvas.box("room", right_x, below + scheduler_height - 56, SIDE_WIDTH, 56, body)
    canvas.arrow(right_middle, below + 68, right_middle, below + scheduler_height - 60)

    world_y = below + scheduler_height + GAP
    canvas.box("room", MARGIN, world_y, WIDTH - 2 * MARGIN, 64, [
        ("head", "the world's port: the long-term model of the building, in a file"),
        ("small", "a frame comes to the board when a knowledge source asks for it; what is learnt revises it there"),
    ])
    canvas.arrow(middle, below + scheduler_height + 4, middle, world_y - 4)
    canvas.text("small left", middle + 12, world_y - GAP // 2 + 4, "requests for frames; frames")
    head = HEAD.format(width=WIDTH, height=world_y + 64 + MARGIN, style=STYLE)
    return head + "\n".join(canvas.elements) + "\n</svg>\n"


def level_lines(level: Level, sources: Iterable[type[KnowledgeSource]]) -> list[Line]:
    """A level's knowledge sources, and what it asks and corrects."""
    names = [name_of(source) for source in sources if source.level is level]
    shown = wrap_names(names) if level is Level.GOAL else names
    question, correction = QUESTIONS[level]
    return [("head", f"{level} level"), *(("", name) for name in shown), ("", ""), ("small", question),
            ("small", correction)]


def name_of(source: type[KnowledgeSource]) -> str:
    """As it is called in words."""
    name = source.__module__.rpartition(".")[2]
    return NAMES.get(name, name.replace("_", " "))


def board_lines(kinds: Registry) -> list[Line]:
    """The kinds of entries, by role."""
    lines: list[Line] = [("head", "the blackboard")]
    for role, title in ROLES.items():
        lines += [("", ""), ("small", title)]
        lines += [("", line) for line in wrap_names([kind.__name__ for kind in kinds.of_role(role)])]
    return [*lines, ("", ""), ("small", "each entry: who wrote it, in which cycle,"),
            ("small", "and which entries it rests on")]


def wrap_names(names: Sequence[str]) -> list[str]:
    """Names on lines that are about equally long."""
    total = len(" · ".join(names))
    most = total / -(-total // BOARD_CHARACTERS)
    lines = [names[0]]
    for name in names[1:]:
        if len(lines[-1]) + len(name) / 2 < most:
            lines[-1] += f" · {name}"
        else:
            lines.append(name)
    return lines


def fit(lines: Sequence[Line]) -> int:
    """The height of a box round lines [px]."""
    return sum(map(height_of, lines)) + 24

