"""What was observed, as values again: from the journal's JSON, the camera's bytes and the world's file."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from blackboard.board import View
from blackboard.effect import Effect, Post, Retract, Revise
from blackboard.entry import Entry, Ref
from blackboard.kinds import Registry
from harvey.errors import BadInput
from harvey.run_files.decoding import decode
from harvey.run_files.records import EntryRecord
from logs.camera_file import Pictures
from world_models.building.locale_frame import FrameReference, LocaleFrame

if TYPE_CHECKING:  # an explanation starts fast only where no world is imported that it does not need
    from world_models.frame_store import FrameStore


@dataclass(frozen=True, slots=True)
class Originals:
    """What the journal names only by reference.

    Attributes:
        pictures: number -> JPEG bytes.
        frames: of the world's locales.
    """

    pictures: Mapping[int, bytes]
    frames: FrameStore


def effect_of(record: EntryRecord, originals: Originals, view: View, kinds: Registry) -> Effect:
    """The effect behind an observed change.

    Args:
        view: the board as it is before the effect.
        kinds: the kinds of entries of that board.

    Raises:
        BadInput: the value is of a kind that is not known, its fields are not the kind's, or its picture is missing.
    """
    because = refs_of(record.because)
    if record.change == "Posted":
        return Post(value_of(record, originals, kinds), because)
    entry = view.get(record.id)
    if entry is None:
        raise BadInput(f"{record.ref}: expected an entry on the board, got none")
    if record.change == "Retracted":
        return Retract(entry, refs_of(record.retracted_because))
    return Revise(entry, value_of(record, originals, kinds), because)


def value_of(record: EntryRecord, originals: Originals, kinds: Registry) -> Any:
    """The value itself. Raises BadInput as :func:`effect_of` does."""
    if record.type == LocaleFrame.__name__:
        return restore_frame(record, originals.frames)
    kind = find_kind(record, kinds)
    value = dict(record.value) if isinstance(record.value, dict) else record.value
    if record.type == "Frame" and isinstance(value, dict):
        value["jpeg"] = _picture(record, value, originals.pictures)
    try:
        return decode(value, kind)
    except (ValueError, TypeError) as error:
        raise BadInput(f"{record.ref}: {error}") from None


def _picture(record: EntryRecord, value: Mapping[str, Any], frames: Mapping[int, bytes]) -> bytes:
    """The bytes of a frame, after checking that they are those that the journal saw."""
    number, seen = value.get("number"), value.get("jpeg")
    if not isinstance(number, int) or number not in frames:
        raise BadInput(f"{record.ref}: expected picture {number} among those that were kept, which are {len(frames)}")
    jpeg = frames[number]
    if not isinstance(seen, dict) or hashlib.sha256(jpeg).hexdigest() != seen.get("sha256"):
        where = f"{frames.where(number)}: " if isinstance(frames, Pictures) else ""
        raise BadInput(f"{where}{record.ref}: expected the picture that the journal saw, got another one for number "
                       f"{number}")
    return jpeg


def restore_frame(record: EntryRecord, store: FrameStore) -> LocaleFrame:
    """The locale frame that a record refers to. Raises BadInput where the world has no such frame."""
    try:
        reference = decode(record.value, FrameReference)
        return store.restore(reference)
    except (ValueError, TypeError) as error:
        raise BadInput(f"{record.ref}: {error}") from None


def find_kind(record: EntryRecord, kinds: Registry) -> type[Any]:
    """The type of a record's value. Raises BadInput where it is not known here."""
    if record.type not in kinds:
        raise BadInput(f"{record.ref}: expected a kind of entry that is known here ({', '.join(sorted(kinds))}), got a "
                       f"{record.type}: is the package that brings it installed?")
    return kinds[record.type]


def entry_of(record: EntryRecord, kinds: Registry, store: FrameStore | None = None) -> Entry[Any]:
    """An entry as it stood on the board, but for the bytes of a picture, which the journal does not keep.

    A locale frame comes from the store; without a store, the reference to it that the journal keeps is the value.

    Raises:
        BadInput: the value is of a kind that is not known, or does not fit it.
    """
    value = {**record.value, "jpeg": b""} if record.type == "Frame" and isinstance(record.value, dict) else record.value
    kind = find_kind(record, kinds)
    if kind is LocaleFrame and store is not None:
        restored: Any = restore_frame(record, store)
    else:
        try:
            restored = decode(value, FrameReference if kind is LocaleFrame else kind)
        except (ValueError, TypeError) as error:
            what = f"expected a {record.type} as this version has it, got another"
            raise BadInput(f"{record.ref}: {what}: {error}") from None
    ref = ref_of(record.ref)
    return Entry(ref.id, ref.revision, restored, record.author, cycle_of_writing(record), refs_of(record.because))


def cycle_of_writing(record: EntryRecord) -> int:
    """In which cycle it was put on the board; what comes from outside is taken up in the next."""
    return record.cycle - record.observed


def refs_of(texts: Iterable[str]) -> tuple[Ref, ...]:
    """Revisions by their names. Raises BadInput."""
    return tuple(ref_of(text) for text in texts)


def ref_of(text: str) -> Ref:
    """A revision by its name, as ``Goal-1.0``. Raises BadInput."""
    id, _, revision = text.rpartition(".")
    if not revision.isdecimal():
        raise BadInput(f"expected a revision as Goal-1.0, got {text!r}")
    return Ref(id, int(revision))
