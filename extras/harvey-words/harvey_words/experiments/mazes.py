"""A maze of corridors: crossings ``c-X-Y`` four metres apart, joined by halls with floors and pictures of their own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

Node = tuple[int, int]
Hall = tuple[Node, Node, str, str]
PITCH_M, WIDTH_M = 4.0, 1.6
COLOURS = {"brick": (0.58, 0.3, 0.25), "blue": (0.2, 0.3, 0.6), "grass": (0.3, 0.55, 0.25), "gravel": (0.5, 0.5, 0.5),
           "flower": (0.85, 0.55, 0.62), "wood": (0.45, 0.3, 0.2), "yellow": (0.8, 0.7, 0.2)}


def write_maze(halls: Sequence[Hall], things: Mapping[Node, str]) -> str:
    """The text of its world file."""
    half = WIDTH_M / 2
    lines = ['name = "maze"', 'units = "metres"', 'include = ["standard"]', "[finishes]"]
    lines += [f'{floor}-floor = {{ colour = {list(rgb)}, words = "{floor}" }}' for floor, rgb in COLOURS.items()]
    lines += ["[locales]"]
    for node in sorted({node for hall in halls for node in hall[:2]}):
        x, y = (PITCH_M * value - half for value in node)
        thing = (f', things = [{{ boxes = [{{ x = [-0.2, 0.2], y = [-0.2, 0.2], z = [0.0, 1.0], finish = "oak" }}], '
                 f'kind = "{things[node]}", at = [{half}, {half}] }}]' if node in things else "")
        lines.append(f'{_crossing(node)} = {{ kind = "crossing", at = [{x}, {y}], '
                     f'size = [{WIDTH_M}, {WIDTH_M}]{thing} }}')
    doors = ["[doors]"]
    for number, (one, two, floor, picture) in enumerate(halls):
        one, two = sorted((one, two))
        level = one[1] == two[1]
        x, y = (PITCH_M * value for value in one)
        at = [x + half, y - half] if level else [x - half, y + half]
        size = [PITCH_M - WIDTH_M, WIDTH_M] if level else [WIDTH_M, PITCH_M - WIDTH_M]
        lines.append(f'hall-{number} = {{ kind = "hallway", at = {at}, size = {size}, floor = "{floor}-floor", '
                     f'words = "{picture}" }}')
        for node, wall in ((one, "east" if level else "north"), (two, "west" if level else "south")):
            doors.append(f'o-{number}-{node[0]}-{node[1]} = {{ between = ["{_crossing(node)}", "hall-{number}"], '
                         f'wall = "{wall}", along = {half}, width = 1.4, open = true, frame = "none" }}')
    return "\n".join([*lines, *doors, ""])


def _crossing(node: Node) -> str:
    return f"c-{node[0]}-{node[1]}"
