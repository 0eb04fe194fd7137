"""Patch files: changes of a world file as a person reads them, one a table, and the world file with those accepted.

A patch is made of one world file, whose digest it names. The file that a patch makes is always made of that file and
the changes that are accepted: so a change that is undone leaves nothing behind.
"""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from harvey.errors import BadInput
from harvey_survey.survey_changes import SurveyChange
from harvey_survey.text_edits import apply_changes

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
