"""Build a house of two rooms from text, draw its plan, and drive a mission in it."""

from pathlib import Path

import harvey
from world_models.building.plan_view import plan_svg

WORLD = """
name = "cottage"
units = "feet"
[finishes]
plaster = { colour = [0.8, 0.77, 0.68] }
oak = { colour = [0.55, 0.38, 0.22] }
[defaults]
walls = "plaster"
frame = "oak"
[parts]
picture = [ { x = [-1.0, 1.0], y = [0.0, 0.1], z = [3.0, 5.0], finish = "oak" } ]
shelf = [ { x = [-1.5, 1.5], y = [0.0, 1.0], z = [0.0, 4.0], finish = "oak" } ]
[locales.kitchen]
kind = "room"
size = [12, 10]
things = [ { part = "picture", wall = "north", along = 4 }, { part = "shelf", wall = "south", along = 9 } ]
[locales.parlour]
kind = "room"
at = [12.5, 0]
size = [14, 10]
things = [ { part = "picture", wall = "east", along = 7 }, { part = "shelf", wall = "north", along = 9 } ]
[doors]
kitchen-door = { between = ["kitchen", "parlour"], wall = "east", along = 5, open = true }
"""
MISSION = """
world = "cottage.toml"
goal = "(ptrans (kitchen (4,5,0)) (parlour (8,5,0)))"
"""

folder = Path("runs") / "cottage"
folder.mkdir(parents=True, exist_ok=True)
(folder / "cottage.toml").write_text(WORLD, encoding="utf-8")
(folder / "to-the-parlour.toml").write_text(MISSION, encoding="utf-8")

world = harvey.build_world(WORLD, "cottage")
(folder / "plan.svg").write_text(plan_svg(world), encoding="utf-8")
print(f"{len(world.locales)} locales; the plan is {folder / 'plan.svg'}")

result = harvey.run(folder / "to-the-parlour.toml", out=folder / "run")
print(f"{result.outcome}, {1000 * result.error_m:.0f} mm from the goal")
