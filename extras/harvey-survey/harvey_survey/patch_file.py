"""Patch files: changes of a world file, one a table, and the file with those accepted: numbers are written in place.

A patch is made of one world file, whose digest it names. The file that a patch makes is always made of that file and
the changes that are accepted: so a change that is undone leaves nothing behind.
"""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from harvey.errors import BadInput
from harvey_survey.adjustment import SurveyChange
from world_models.building.model_errors import WALL
from world_models.files.construction.builder import compute_world_poses
from world_models.files.construction.specs import ThingSpec, WorldSpec
from world_models.files.toml.placements import UNITS_M, Placement
from world_models.files.toml.source import Key, Source, TomlScanner
from world_models.files.toml.world_reader import WorldReader

DIGITS = 4
"""Of a length that is written anew, in the unit of the file: below a tenth of a millimetre."""
INTO_AXIS = {"west": (0, 1.0), "east": (0, -1.0), "south": (1, 1.0), "north": (1, -1.0)}
"""Of the walls of a room with a size: the axis along which one moves, and the way into the room."""


Edit = tuple[int, int, str]
"""From where to where in a text it becomes another."""


class CannotEditError(Exception):
    """A change cannot be made in the text; says why."""


@dataclass
class _Spans(TomlScanner):
    """Where each value begins and ends."""

    spans: dict[Key, tuple[int, int]] = field(default_factory=dict)

    def _value(self, key: Key) -> None:
        start = self.at
        super()._value(key)
        self.spans[key] = start, start + len(self.text[start : self.at].rstrip())


@dataclass
class _Places(WorldReader):
    """A reader that keeps where each thing is placed."""

    places: dict[str, Placement] = field(default_factory=dict)

    def _build_thing(self, locale: str, place: Placement) -> ThingSpec:
        spec = super()._build_thing(locale, place)
        self.places[f"{locale}/{spec.name}"] = place
        return spec


def apply_changes(path: Path, changes: Sequence[SurveyChange]) -> tuple[str, tuple[tuple[SurveyChange, str], ...]]:
    """The text of a world file with changes made, and those that could not be made, each with the reason.

    Raises WorldError where the file cannot be read.
    """
    editor = _Editor(Source.read(path))
    left: list[tuple[SurveyChange, str]] = []
    for change in changes:
        try:
            editor.make(change)
        except CannotEditError as error:
            left.append((change, str(error)))
    return editor.write(), tuple(left)


class _Editor:
    """The numbers of a file, and by how much each is to grow; edits besides."""

    def __init__(self, source: Source) -> None:
        self._source, self._text = source, source.text
        scanner = _Spans(source.text)
        scanner.scan()
        self._spans = scanner.spans
        self._reader = _Places(source)
        self._reader.read_base()
        self._spec: WorldSpec = self._reader.spec()
        self._unit_m = UNITS_M[str(source.data["units"])]
        self._grown: dict[Key, float] = {}
        self._gone: list[str] = []

    def make(self, change: SurveyChange) -> None:
        """Raises CannotEditError, and has then changed nothing."""
        if change.is_gone:
            self._find_place(change.name)
            self._gone.append(change.name)
        elif change.kind == "wall":
            self._grow(self._list_wall(change.name, change.moved["into"]))
        elif change.kind == "door":
            self._grow({self._number(("doors", change.name, "along")): change.moved["along"]})
        else:
            self._grow({self._find_number(change.name, axis): by_cm for axis, by_cm in change.moved.items()})

    def write(self) -> str:
        edits = [self._rewrite(key, by_cm) for key, by_cm in self._grown.items()]
        edits += self._take_out()
        text, last = "", 0
        for start, end, new in sorted(edits):
            if start >= last:  # a number in what is taken out goes with it
                text += self._text[last:start] + new
                last = end
        return text + self._text[last:]

    # -- numbers ---------------------------------------------------------------------------------------------------

    def _grow(self, numbers: dict[Key, float]) -> None:
        for key, by_cm in numbers.items():
            self._grown[key] = self._grown.get(key, 0.0) + by_cm

    def _number(self, key: Key) -> Key:
        """The key, where a number stands there in this file. Raises CannotEditError."""
        words = ".".join(map(str, key))
        if key not in self._spans:
            raise CannotEditError(f"{words} does not stand in {self._source.name} itself")
        try:
            self._read(key)
        except ValueError:
            raise CannotEditError(f"{words} is no single number") from None
        return key

    def _read(self, key: Key) -> float:
        start, end = self._spans[key]
        return float(self._text[start:end].replace("_", ""))

    def _rewrite(self, key: Key, by_cm: float) -> Edit:
        start, end = self._spans[key]
        text = f"{self._read(key) + 0.01 * by_cm / self._unit_m:.{DIGITS}f}".rstrip("0").rstrip(".")
        return start, end, "0.0" if text in ("-0", "0") else text

    # -- things ----------------------------------------------------------------------------------------------------

    def _find_place(self, name: str) -> Placement:
        place = self._reader.places.get(name)
        if place is None or place.node.source is not self._source or place.node.key not in self._spans:
            raise CannotEditError(f"{name} is not placed in {self._source.name} itself")
        shared = [other for other in self._reader.places.values() if other.node.key == place.node.key]
        if len(shared) > 1:
            raise CannotEditError(f"{name} is one of several that are placed by one step")
        return place

    def _find_number(self, name: str, axis: str) -> Key:
        place = self._find_place(name)
        key = place.node.key
        is_table = self._text[self._spans[key][0]] == "{"
        if axis == "up":
            if not is_table:
                raise CannotEditError(f"{name} has its height from a row")
            return self._number((*key, "up"))
        if place.wall is not None:
            return self._number((*key, "along") if is_table else key)
        at: Key = (*key, "at") if is_table else key
        return self._number((*at, "xy".index(axis)))

    def _take_out(self) -> list[Edit]:
        """Edits by which things go; those of their kind that are numbered after them keep their names."""
        edits: list[Edit] = []
        for name in self._gone:
            place = self._find_place(name)
            start, end = self._spans[place.node.key]
            if place.name is not None and self._text[start] != "{":
                end = self._spans[place.name.key][1]
            edits.append(self._cut(place.node.key, start, end))
        for name in self._list_renumbered():
            place = self._reader.places[name]
            start, end = self._spans[place.node.key]
            own = name.partition("/")[2]
            is_table = self._text[start] == "{"
            edits.append((start + 1, start + 1, f' name = "{own}",') if is_table else (end, end, f', "{own}"'))
        return edits

    def _list_renumbered(self) -> list[str]:
        """Things without a name of their own, after one of their kind that goes."""
        found: list[str] = []
        numbered: set[tuple[str, str]] = set()
        for name, place in self._reader.places.items():
            kind = name.partition("/")[0], place.kind
            if name in self._gone and place.name is None:
                numbered.add(kind)
            elif kind in numbered and place.name is None and place.node.key in self._spans:
                found.append(name)
        return found

    def _cut(self, key: Key, start: int, end: int) -> Edit:
        """Without the comma and the space before it; the whole row where it is the only place in it."""
        row = key[:-1]
        if self._text[start] != "{" and sum(other.node.key[:-1] == row for other in self._reader.places.values()) == 1:
            start, end = self._spans[row]
        before = len(self._text[:start].rstrip())
        if self._text[before - 1] == ",":
            return before - 1, end, ""
        after = len(self._text) - len(self._text[end:].lstrip())
        return start, after + 1 if self._text[after : after + 1] == "," else end, ""

    # -- walls -----------------------------------------------------------------------------------------------------

    def _list_wall(self, mode: str, into_cm: float) -> dict[Key, float]:
        """The numbers that change where a wall is displaced: on both its sides, where a door leads through it."""
        room, _, number = mode.rpartition(WALL)
        own = self._spec.locales[room].wall_names[int(number)]
        numbers = self._list_side(room, own, into_cm)
        for other, wall in self._list_behind(room, own):
            for key, by_cm in self._list_side(other, wall, -into_cm).items():
                numbers[key] = numbers.get(key, 0.0) + by_cm
        return numbers

    def _list_behind(self, room: str, wall: str) -> list[tuple[str, str]]:
        """The walls of other rooms to which open doors in a wall lead."""
        found = []
        for door in self._spec.doors:
            if door.is_open and len(door.between) == 2 and room in door.between:
                is_first = door.between[0] == room
                other = door.between[is_first]
                back = self._find_back(room, wall, other)
                if door.wall == (wall if is_first else back):
                    found.append((other, back))
        return list(dict.fromkeys(found))

    def _find_back(self, room: str, wall: str, other: str) -> str:
        """The wall of another room that is the back of a wall of this one."""
        axis, sign = INTO_AXIS[wall]
        places = compute_world_poses(self._spec.locales, self._spec.name)
        seen = -sign * (places[other].rotation.T @ places[room].rotation[:, axis])
        return max(INTO_AXIS, key=lambda name: float(seen[INTO_AXIS[name][0]] * INTO_AXIS[name][1]))

    def _list_side(self, room: str, wall: str, into_cm: float) -> dict[Key, float]:
        """The numbers of one side: the room's size, and, where its origin moves, its place and all that is in it."""
        spec = self._spec.locales[room]
        if wall not in INTO_AXIS:
            raise CannotEditError(f"{room} has an outline")
        axis, sign = INTO_AXIS[wall]
        numbers = {self._number(("locales", room, "size", axis)): -into_cm}
        if sign < 0.0:
            return numbers
        step = spec.frame.rotation[:2, axis] * into_cm
        for i in (0, 1):
            if abs(step[i]) > 1e-9:
                numbers[self._number(("locales", room, "at", i))] = float(step[i])
        across = ("south", "north") if axis == 0 else ("west", "east")
        for thing in self._spec.things:
            name = f"{room}/{thing.name}"
            if thing.locale == room and (thing.wall is None or thing.wall in across) and name not in self._gone:
                numbers[self._find_number(name, "along" if thing.wall else "xy"[axis])] = -into_cm
        for door in self._spec.doors:
            if door.between[0] == room and door.wall in across:
                numbers[self._number(("doors", door.name, "along"))] = -into_cm
        if any(room in link.between for link in self._spec.links):
            raise CannotEditError(f"{room} has an elevator or stairs")
        return numbers


AXES = ("into", "along", "up", "x", "y")
NOTE = """# Changes of {world}, by harvey survey. One a table: what stands elsewhere by so many centimetres, in
# the file's own directions (into the room; along its wall as the file counts; up; x and y of its room), each with its
# standard deviation; or what is gone. certainty: the probability of the change. accepted: whether the file that is
# written has it; say so with --accept N,... and --undo N,... why_not: why it cannot be written there.
"""


@dataclass(frozen=True, slots=True)
class Proposal:
    """A change with its number in the patch; why_not: why it cannot be made in the text, or ""."""

    number: int
    change: SurveyChange
    is_accepted: bool = True
    why_not: str = ""


@dataclass(frozen=True, slots=True)
class Patch:
    """Proposals for a world file: its name, the digest of its bytes, and how many runs and pictures speak for them."""

    world: str
    sha256: str
    runs: int
    pictures: int
    proposals: tuple[Proposal, ...]

    def accepting(self, numbers: Collection[int], *, is_accepted: bool, others: bool | None = None) -> Patch:
        """With these accepted or not; the others so too where ``others`` says. Raises BadInput for a number it lacks.
        """
        known = {proposal.number for proposal in self.proposals}
        if lacking := sorted(set(numbers) - known):
            have = f"1 to {max(known)}" if known else "none"
            raise BadInput(f"expected numbers of changes, which are {have}, got {lacking[0]}")

        def decide(one: Proposal) -> bool:
            return is_accepted if one.number in numbers else one.is_accepted if others is None else others

        return replace(self, proposals=tuple(replace(one, is_accepted=decide(one)) for one in self.proposals))


def build_patch(path: Path, changes: Sequence[SurveyChange], runs: int, pictures: int) -> Patch:
    """The patch of a world file, its changes numbered from 1; all that can be made are accepted."""
    left = {(change.kind, change.name): why for change, why in apply_changes(path, changes)[1]}
    proposals = tuple(
        Proposal(number, change, (change.kind, change.name) not in left, left.get((change.kind, change.name), ""))
        for number, change in enumerate(changes, 1))
    return Patch(path.name, _digest(path), runs, pictures, proposals)


def write_world(path: Path, patch: Patch) -> bytes:
    """The bytes of the world file with what is accepted. Raises BadInput where the file is not that of the patch."""
    data = path.read_bytes()
    if _digest(path) != patch.sha256:
        raise BadInput(f"{path}: expected the world file of the patch (SHA-256 {patch.sha256[:8]}), got another")
    accepted = [one.change for one in patch.proposals if one.is_accepted and not one.why_not]
    if not accepted:
        return data
    text, _ = apply_changes(path, accepted)
    text = text.replace("\n", "\r\n") if b"\r\n" in data else text
    return (b"\xef\xbb\xbf" if data.startswith(b"\xef\xbb\xbf") else b"") + text.encode()


def format_patch(patch: Patch) -> str:
    """A patch as TOML."""
    head = [NOTE.format(world=patch.world), f"world = {json.dumps(patch.world)}", f'sha256 = "{patch.sha256}"',
            f"runs = {patch.runs}", f"pictures = {patch.pictures}"]
    for one in patch.proposals:
        change = one.change
        what = [f"{axis}_cm = {by_cm:g}\n{axis}_sigma_cm = {change.sigmas[axis]:g}"
                for axis, by_cm in change.moved.items()] or ["gone = true"]
        head += ["\n[[change]]", f"number = {one.number}", f"{change.kind} = {json.dumps(change.name)}", *what,
                 f"certainty = {change.certainty:.6f}", f"evidence = {json.dumps(change.evidence)}",
                 f"accepted = {str(one.is_accepted).lower()}",
                 *([f"why_not = {json.dumps(one.why_not)}"] if one.why_not else [])]
    return "\n".join(head) + "\n"


def read_patch(path: Path) -> Patch:
    """A patch file. Raises BadInput where it cannot be read, or is none."""
    try:
        data = tomllib.loads(path.read_text("utf-8"))
        proposals = tuple(_read_proposal(table) for table in data.get("change", []))
        patch = Patch(str(data["world"]), str(data["sha256"]), int(data["runs"]), int(data["pictures"]), proposals)
    except OSError as error:
        raise BadInput(f"--patch {path}: expected a readable file, got: {error.strerror}") from None
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise BadInput(f"--patch {path}: expected a patch as harvey survey writes it, got: {error}") from None
    if len({one.number for one in proposals}) != len(proposals):
        raise BadInput(f"--patch {path}: expected each number once, got one that is there twice")
    return patch


def _read_proposal(table: dict[str, Any]) -> Proposal:
    kind = next(kind for kind in ("wall", "door", "thing", "") if kind in table or not kind)
    moved = {axis: float(table[f"{axis}_cm"]) for axis in AXES if f"{axis}_cm" in table}
    if not kind or bool(moved) == bool(table.get("gone", False)):
        raise ValueError(f"a change that names no wall, door or thing, or says nothing of it: {table}")
    sigmas = {axis: float(table[f"{axis}_sigma_cm"]) for axis in moved}
    change = SurveyChange(kind, str(table[kind]), moved, sigmas, float(table["certainty"]), str(table["evidence"]))
    return Proposal(int(table["number"]), change, bool(table["accepted"]), str(table.get("why_not", "")))


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
