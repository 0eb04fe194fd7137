"""A small tower for tests: a hall on every floor, and an elevator beside them."""

HALL = """
[locales.hall-{floor}]
kind = "hallway"
in = "house"
at = [0, 0, {z}]
size = [8, 2.6]
walls = {walls}
things = [ ["floor-{floor}", "north", {sign}], ["pillar", "north", {pillar}], ["notice-board", "south", 3.6],
  ["picture", "west", {sign}], ["picture", "north", 4.9], ["hose-cabinet", "south", 5.6], ["white-board", "east", 1.2] ]
"""
WALLS = ('["sand", "brick", "cream", "sky"]', '["sage", "sky", "sand", "cream"]', '["sky", "sage", "cream", "brick"]')


def tower(floors: int = 2, *, storey_m: float = 3.6, turn_deg: float = 0.0, hall_stop_m: float = 1.05) -> str:
    """The text of a world file, in metres: ``hall-1`` .. and ``car-1`` .., floors ``storey_m`` apart.

    Args:
        turn_deg: how the house stands in the world.
        hall_stop_m: how far along the halls the elevator's doors are.
    """
    cars = ", ".join(f'"car-{floor}"' for floor in range(1, floors + 1))
    text = ['name = "tower"\nunits = "metres"\ninclude = ["standard", "vertical"]\n',
            f'[locales.house]\nkind = "building"\nat = [3, -2]\nturn = {turn_deg!r}\n',
            f'[locales.elevator]\nkind = "elevator"\nin = "house"\nat = [{hall_stop_m - 1.05!r}, -2.25]\n']
    for floor in range(1, floors + 1):
        z = (floor - 1) * storey_m
        text.append(HALL.format(floor=floor, z=z, walls=WALLS[(floor - 1) % 3], pillar=2.4 + 0.5 * floor,
                                sign=0.5 + 0.3 * floor))
        text.append(f'[locales.car-{floor}]\nkind = "landing"\nin = "elevator"\nat = [0, 0, {z}]\nsize = [2.1, 2.1]\n'
                    'height = 2.4\nwalls = "steel"\nmoulding = "none"\nfloor = "rubber"\n'
                    'things = [ ["panels", "west", 1.05], ["panels", "south", 1.05], ["panels", "east", 1.05] ]\n')
    text.append("[doors]")
    text += [f'door-{floor} = {{ between = ["hall-{floor}", "car-{floor}"], wall = "south", along = {hall_stop_m!r}, '
             "width = 1.0, open = true }" for floor in range(1, floors + 1)]
    text.append(f'[links]\nelevator = {{ kind = "elevator", between = [{cars}], stop = [1.05, 1.0, 90] }}\n')
    return "\n".join(text)
