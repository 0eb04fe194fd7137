"""Generated houses: a few rooms in a row, as a world file, for visibility."""

from __future__ import annotations

import numpy as np


def generate_house(rng: np.random.Generator) -> str:
    """Generate a world file: two or three rooms in a row, with open doors, boxes and boards."""
    text = ['name = "house"\nunits = "metres"', "[finishes]\nplain = { colour = [0.6, 0.6, 0.6] }",
            '[defaults]\nheight = 2.6\nwalls = "plain"\nbaseboard = "plain"\nframe = "plain"', "[parts]"]
    for part in range(3):
        x, y, z = rng.uniform(0.2, 0.6), rng.uniform(0.3, 0.8), rng.uniform(0.4, 2.0)
        text.append(f'p{part} = [ {{ x = [{-x:.3f}, {x:.3f}], y = [0.0, {y:.3f}], z = [0.0, {z:.3f}],'
                    ' finish = "plain" },'
                    f' {{ x = [{-x:.3f}, {x / 2:.3f}], y = [0.0, {y / 2:.3f}], z = [{z:.3f}, {z + 0.3:.3f}],'
                    ' finish = "plain" } ]')
    rooms, doors, at = int(rng.integers(2, 4)), [], 0.0
    for room in range(rooms):
        width, depth = rng.uniform(3.5, 6.0), rng.uniform(3.5, 5.0)
        things = [f'{{ part = "p{rng.integers(3)}", at = [{rng.uniform(1.0, width - 1.0):.3f},'
                  f' {rng.uniform(0.8, depth - 1.0):.3f}], turn = {rng.uniform(-30, 30):.2f} }}']
        things += [f'{{ part = "p{rng.integers(3)}", wall = "north", along = {width * part:.3f} }}'
                   for part in (0.25, 0.75)]
        text.append(f"[locales.r{room}]\nkind = 'room'\nat = [{at:.3f}, 0]\nsize = [{width:.3f}, {depth:.3f}]\n"
                    f"things = [ {', '.join(things)} ]")
        if room:
            doors.append(f"d{room} = {{ between = ['r{room - 1}', 'r{room}'], wall = 'east',"
                         f" along = {rng.uniform(0.8, 2.6):.3f}, open = true }}")
        at += width + rng.uniform(0.1, 0.4)
    return "\n".join([*text, "[doors]", *doors])
