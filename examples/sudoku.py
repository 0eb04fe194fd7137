"""A sudoku of 4 x 4 by two competing experts: the only digit of a cell, or the only cell of a digit."""

from blackboard import History, Post, Scheduler, inference, rule

PUZZLE = ("1...", "...2", "..4.", ".3..")
CELLS = [(row, column) for row in range(4) for column in range(4)]
UNITS = [[cell for cell in CELLS if key(cell) == number] for number in range(4)
         for key in (lambda c: c[0], lambda c: c[1], lambda c: c[0] // 2 * 2 + c[1] // 2)]


@inference
class Placed:
    row: int
    column: int
    digit: int


def read_board(view):
    """What is placed, by cell; and for each empty cell the digits that stand in a unit of it, with where they stand."""
    placed = {(entry.value.row, entry.value.column): entry for entry in view.all(Placed)}
    excluded = {cell: {placed[other].value.digit: placed[other] for unit in UNITS if cell in unit for other in unit
                       if other in placed} for cell in CELLS if cell not in placed}
    return placed, excluded


def find_only_digit(view, trigger):
    _, excluded = read_board(view)
    for cell, digits in excluded.items():
        if len(digits) == 3:
            return cell, ({1, 2, 3, 4} - set(digits)).pop(), tuple(digits.values())
    return None


def find_only_place(view, trigger):
    placed, excluded = read_board(view)
    for unit in UNITS:
        for digit in {1, 2, 3, 4} - {placed[cell].value.digit for cell in unit if cell in placed}:
            free = [cell for cell in unit if cell in excluded]
            open_to_it = [cell for cell in free if digit not in excluded[cell]]
            if len(open_to_it) == 1:
                by = [excluded[cell][digit] for cell in free if digit in excluded[cell]]
                return open_to_it[0], digit, (*by, *(placed[cell] for cell in unit if cell in placed))
    return None


@rule(on=Placed, writes=Placed, bind=find_only_digit)
def only_digit(view, case):
    (row, column), digit, because = case
    yield Post(Placed(row, column, digit), because)


@rule(on=Placed, writes=Placed, bind=find_only_place)
def only_place(view, case):
    (row, column), digit, because = case
    yield Post(Placed(row, column, digit), because)


history = History()
scheduler = Scheduler([only_digit, only_place], sinks=[history])
scheduler.post([Post(Placed(r, c, int(PUZZLE[r][c]))) for r, c in CELLS if PUZZLE[r][c] != "."], "puzzle")
cycles = scheduler.run()

found = {(entry.value.row, entry.value.column): entry for entry in scheduler.view.all(Placed)}
for row in range(4):
    print(" ".join(str(found[row, column].value.digit) if (row, column) in found else "." for column in range(4)))
by = [entry.author for entry in found.values()]
print(f"in {cycles} cycles; only_digit placed {by.count('only_digit')}, only_place {by.count('only_place')}")
print(f"the last cell: {history.why(list(scheduler.view.all(Placed))[-1].id).splitlines()[0]}")
