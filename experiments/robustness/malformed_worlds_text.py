"""A small valid world file that uses every feature of the format."""

SMALL = """\
name = "cottage"
units = "metres"

[finishes]
plain = { colour = [0.5, 0.5, 0.5], texture = "brick", scale = 0.2 }
oak = { colour = [0.55, 0.38, 0.22] }

[defaults]
height = 2.5
walls = "plain"
baseboard = "oak"
moulding = "oak"
frame = "oak"
leaf = "plain"
threshold = "oak"
door_width = 0.9
door_height = 2.0

[parts]
chest = [ { x = [-0.5, 0.5], y = [0.0, 0.5], z = [0.0, 1.0], finish = "plain", twin = false },
          { x = [-0.5, 0.5], y = [0.0, 0.1], z = [1.0, 2.0], finish = "oak", rim = "plain", rim_width = 0.1 } ]
panel = [ { x = [-0.2, 0.2], y = [0.0, 0.02], z = [1.0, 1.5], finish = "plain" } ]

[locales.ground]
kind = "floor"
survey = { sigma = 0.05, sigma_deg = 0.2 }

[locales.kitchen]
kind = "room"
in = "ground"
size = [4, 3]
walls = { south = "oak", east = "plain", north = "plain", west = "oak" }
properties = { owner = "Ann", seats = 4, warm = true }
things = [ { part = "chest", wall = "north", along = 1.0, name = "chest" },
           { part = "chest", at = [2, 1], turn = 90, finish = "oak" },
           { finish = "oak", wall = "west", along = 2, up = 1, boxes = [
               { x = [0, 0.3], y = [0, 0.1], z = [0, 0.3] } ] } ]

[locales.parlour]
kind = "room"
in = "ground"
at = [4.2, 0]
height = 3
outline = [[0, 0], [5, 0], [5, 2], [3, 2], [3, 3], [0, 3]]

[doors]
between-them = { between = ["kitchen", "parlour"], wall = "east", along = 1.5, open = true, width = 1 }
pantry = { between = ["kitchen"], wall = "south", along = 0.8, panel = "panel", leaf = "oak" }
"""
