"""The journal read back: each line a decision, each change an entry with the value that it had on the board.

A value is decoded when it is first asked for; what the journal keeps only by reference (the bytes of a picture, a
locale frame) is left as that, unless the originals are at hand (:func:`effect_of`). A kind that is not known here, as
of a package that is not installed, is :class:`Opaque`: its fields can be read all the same.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache, cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeGuard, TypeVar, cast, get_args

import numpy as np

from blackboard import (
    Change,
    Decoders,
    Effect,
    Entry,
    Post,
    Posted,
    Quiescence,
    Ref,
    Registry,
    Retract,
    Retracted,
    Revise,
    Revised,
    View,
    brief,
    decode,
)
from logs.mjpeg_file import Pictures
from logs.run_errors import BadInput
from world_models import words
from world_models.building.locale_frame import FrameReference, FrameRequest, LocaleFrame
from world_models.entries import CameraPicture, Discrepancy
from world_models.entries.entry_kinds import KINDS

if TYPE_CHECKING:  # an explanation starts fast only where no world is imported that it does not need
    from world_models.frame_store import FrameStore

WHAT_IF = "what if"
"""The author of the revisions by which a question of what would have been is asked."""
OWN = Registry((*KINDS, Discrepancy, Quiescence))
"""The kinds that come with the project: no knowledge source needs to be loaded to read them."""
CHANGES: Mapping[str, type[Change]] = {kind.__name__: kind for kind in (Posted, Revised, Retracted)}
Kind = type[Any]
K = TypeVar("K")
T_co = TypeVar("T_co", covariant=True)
_GIVEN: ContextVar[Registry] = ContextVar("given", default=OWN)


@dataclass(frozen=True, slots=True)
class Opaque:
    """A value of a kind that is not known here.

    Attributes:
        fields: as JSON types.
    """

    fields: Any

    def sentence(self) -> str:
        return words.fields(self.fields)


@contextmanager
def knowing(kinds: Registry) -> Iterator[None]:
    """For a while, also the kinds that the calling program brought."""
    before = _GIVEN.set(kinds)
    try:
        yield
    finally:
        _GIVEN.reset(before)


@cache
def _foreign_kinds() -> Registry:
    from blackboard import KnowledgeSource, registry_of
    from world_models.plugins import GUESTS_GROUP, SOURCES_GROUP, load_plugin_classes

    found = [load_plugin_classes(group, KnowledgeSource).values() for group in (SOURCES_GROUP, GUESTS_GROUP)]
    return registry_of([source for sources in found for source in sources], KINDS)


def kinds_for(type: str) -> Registry:
    """The kinds that are known here; those of other packages are loaded only for an entry that needs them."""
    if type in OWN:
        return OWN
    return given if type in (given := _GIVEN.get()) else _foreign_kinds()


@dataclass(frozen=True)
class EntryRecord(Generic[T_co]):
    """One change of one entry, as the journal tells it.

    Attributes:
        change: Posted, Revised or Retracted.
        ref: ``Goal-1.0``.
        type: the name of its kind; :attr:`kind` is the kind itself.
        author: knowledge source or port.
        because: refs of the revisions that it rests on.
        fields: of the value, as JSON types; :attr:`value` is the value itself.
        cycle: of the decision that made it, or that took it up where it came from outside.
        observed: whether it came from outside.
        retracted_because: of a retraction: what it rests on itself.
    """

    change: str
    ref: str
    type: str
    author: str
    because: tuple[str, ...]
    fields: Any
    cycle: int
    observed: bool
    retracted_because: tuple[str, ...] = ()

    @property
    def id(self) -> str:
        """The entry without its revision."""
        return self.ref.rpartition(".")[0]

    @property
    def revision(self) -> int:
        """Its number among those of the entry; 0 is the first."""
        return ref_of(self.ref).revision

    @property
    def is_gone(self) -> bool:
        """Whether the change is that the entry is no longer believed."""
        return self.change == Retracted.__name__

    @property
    def is_new(self) -> bool:
        """Whether it is the first of the entry."""
        return self.change == Posted.__name__

    def field(self, name: str, otherwise: Any = None) -> Any:
        """One field of the value without decoding it; ``otherwise`` where there is none of that name."""
        return self.fields.get(name, otherwise) if isinstance(self.fields, dict) else otherwise

    @cached_property
    def kind(self) -> Kind:
        """The class of its value, which need not be decoded for that; Opaque where it is not known here."""
        kinds = kinds_for(self.type)
        return kinds.get(self.type, Opaque)

    @cached_property
    def value(self) -> T_co:
        """As it was on the board, but a picture has no bytes, and a locale frame is the reference to it.

        Raises BadInput where the fields are not those of its kind: the run is of another version.
        """
        if self.kind is Opaque:
            return cast(T_co, Opaque(self.fields))
        return cast(T_co, value_of(self, kinds_for(self.type)))


def is_a(record: EntryRecord[Any] | None, kind: type[K]) -> TypeGuard[EntryRecord[K]]:
    """Whether an entry is of a kind; its value is not decoded for that."""
    return record is not None and record.kind is kind


@dataclass(frozen=True, slots=True)
class Candidate:
    """An activation, as the journal tells it: a knowledge source that was woken, and could act.

    Attributes:
        number: sequence number; ties go by it.
        source, level: who would act, and at which servo level: action, plan or goal.
        trigger, kind: the entry whose change woke it, as ``Leg-3.0``, and which change: Posted, Revised or Retracted.
        rating: how urgent, 0 to 1.
        since: the cycle in which it was woken.
        reason: why it was dropped, if it was.
    """

    number: int
    source: str
    level: str
    trigger: str
    kind: str
    rating: float
    since: int
    reason: str = ""


@dataclass(frozen=True, slots=True)
class DecisionRecord:
    """One decision: a line of the journal, as ``RecordedRun.decisions()`` yields them.

    Attributes:
        cycle: its number, from 1.
        focus: the servo level in focus: action, plan or goal.
        observed: entries that came from outside: commands, pictures, odometry.
        seen: the changes that were taken up, as ``Leg-3.0``.
        activated, obviated: who was woken, and whose turn was dropped, with the reason.
        chosen, runner_up: who acted and who was next best; None where nobody could.
        pending: how many were left waiting.
        made: the entries that the act wrote.
        refused: why the act was not applied, or "".
        data: the line as JSON types.
        used: the revisions of traced kinds that the act read, as ``LocaleFrame-1.0``.
    """

    cycle: int
    focus: str
    observed: tuple[EntryRecord[Any], ...]
    seen: tuple[str, ...]
    activated: tuple[Candidate, ...]
    obviated: tuple[Candidate, ...]
    chosen: Candidate | None
    runner_up: Candidate | None
    pending: int
    made: tuple[EntryRecord[Any], ...]
    refused: str
    data: Mapping[str, Any]
    used: tuple[str, ...] = ()

    @property
    def asks(self) -> EntryRecord[FrameRequest] | None:
        """What the act lacked and asked for, where that was all that it did: it comes again when it is answered."""
        first = self.made[0] if len(self.made) == 1 and self.made[0].is_new else None
        return first if is_a(first, FrameRequest) else None

    @property
    def changes(self) -> tuple[EntryRecord[Any], ...]:
        """What was observed, then what it made."""
        return (*self.observed, *self.made)

    @property
    def line(self) -> str:
        """As it stands in the journal, without its newline."""
        return as_line(self.data)


def _array(value: Any, hint: tuple[Any, ...]) -> np.ndarray[Any, Any]:
    """A frozen array from JSON types; the hint is that of its annotation. Raises ValueError."""
    element = get_args(hint[1])[0]
    try:
        array = np.array(value, dtype=element)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"expected an array of {element.__name__}, got {brief(value)}") from None
    array.setflags(write=False)
    return array


ARRAYS: Decoders = MappingProxyType({np.ndarray: _array})


def as_line(data: Any) -> str:
    """JSON types as one line, as the journal writes them; equal lines mean equal values to the last bit."""
    return json.dumps(data, separators=(",", ":"))


def decision_at(line: bytes, where: str) -> DecisionRecord:
    """A line of a journal as a decision. Raises BadInput naming ``where``, what was expected and what came."""
    try:
        data = json.loads(line)
        if not isinstance(data, dict):
            raise ValueError("it is no object")
    except RecursionError:
        raise BadInput(f"{where}: expected a decision, got too many nested brackets") from None
    except ValueError as error:
        raise BadInput(f"{where}: expected a decision as a JSON object, got {line[:60]!r} ({error})") from None
    try:
        return decision_of(data)
    except ValueError as error:
        raise BadInput(f"{where}: {error}") from None


def decision_of(data: Any) -> DecisionRecord:
    """A decision from JSON types. Raises ValueError naming the key, what was expected and what came."""
    cycle = _get(data, "cycle", int)
    return DecisionRecord(
        cycle=cycle,
        focus=_get(data, "focus", str),
        observed=tuple(_entry(item, cycle, True) for item in _get(data, "observed", list)),
        seen=_texts(data, "seen"),
        activated=tuple(_candidate(item) for item in _get(data, "activated", list)),
        obviated=tuple(_candidate(item, _get(item, "reason", str)) for item in _get(data, "obviated", list)),
        chosen=_optional(data, "chosen"),
        runner_up=_optional(data, "runner_up"),
        pending=_get(data, "pending", int),
        made=tuple(_entry(item, cycle, False) for item in _get(data, "made", list)),
        refused=_get(data, "refused", str),
        data=data,
        used=_texts(data, "used", ()),
    )


def _entry(item: Any, cycle: int, observed: bool) -> EntryRecord[Any]:
    return EntryRecord(
        _get(item, "change", str), _get(item, "entry", str), _get(item, "type", str), _get(item, "author", str),
        _texts(item, "because"), _get(item, "value", object), cycle, observed, _texts(item, "retracted_because", ()))


def _candidate(item: Any, reason: str = "") -> Candidate:
    return Candidate(
        _get(item, "number", int), _get(item, "source", str), _get(item, "level", str), _get(item, "trigger", str),
        _get(item, "kind", str), float(_get(item, "rating", (int, float))), _get(item, "since", int), reason)


def _optional(data: Any, key: str) -> Candidate | None:
    item = _get(data, key, object)
    return None if item is None else _candidate(item)


def _texts(data: Any, key: str, otherwise: tuple[str, ...] | None = None) -> tuple[str, ...]:
    if otherwise is not None and key not in data:
        return otherwise
    items = _get(data, key, list)
    if not all(isinstance(item, str) for item in items):
        raise ValueError(f"{key}: expected texts, got {items!r}")
    return tuple(items)


def _get(data: Any, key: str, kind: type | tuple[type, ...]) -> Any:
    if not isinstance(data, dict):
        raise ValueError(f"expected an object with the key {key!r}, got {type(data).__name__}")
    if key not in data:
        raise ValueError(f"expected the key {key!r}, got keys {', '.join(data) or 'none'}")
    value = data[key]
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not object):
        names = " or ".join(k.__name__ for k in (kind if isinstance(kind, tuple) else (kind,)))
        raise ValueError(f"{key}: expected {names}, got {type(value).__name__}")
    return value


class Originals(NamedTuple):
    """What the journal names only by reference: JPEG bytes by a picture's number, and frames of the world's locales."""

    pictures: Mapping[int, bytes]
    frames: FrameStore


def effect_of(record: EntryRecord[Any], originals: Originals, view: View, kinds: Registry) -> Effect:
    """The effect behind an observed change.

    Args:
        view: the board as it is before the effect.
        kinds: the kinds of entries of that board.

    Raises:
        BadInput: the value is of a kind that is not known, its fields are not the kind's, or its picture is missing.
    """
    because = refs_of(record.because)
    if record.is_new:
        return Post(value_of(record, kinds, *originals), because)
    entry = view.get(record.id)
    if entry is None:
        raise BadInput(f"{record.ref}: expected an entry on the board, got none")
    if record.is_gone:
        return Retract(entry, refs_of(record.retracted_because))
    return Revise(entry, value_of(record, kinds, *originals), because)


def value_of(
    record: EntryRecord[Any], kinds: Registry, pictures: Mapping[int, bytes] | None = None,
    frames: FrameStore | None = None,
) -> Any:
    """The value itself; without pictures or frames it has no bytes, or is the reference.

    Raises BadInput where it does not fit its kind.
    """
    if record.type not in kinds:
        raise BadInput(f"{record.ref}: expected a kind of entry that is known here ({', '.join(sorted(kinds))}), got a "
                       f"{record.type}: is the package that brings it installed?")
    fields, kind = record.fields, kinds[record.type]
    if kind is CameraPicture and isinstance(fields, dict):
        fields = {**fields, "jpeg": b"" if pictures is None else _picture(record, pictures)}
    try:
        value = decode(fields, FrameReference if kind is LocaleFrame else kind, ARRAYS)
        return value if frames is None or kind is not LocaleFrame else frames.restore(value)
    except (ValueError, TypeError) as error:
        what = f"expected a {record.type} as this version has it, got another"
        raise BadInput(f"{record.ref}: {what}: {error}") from None


def _picture(record: EntryRecord[Any], pictures: Mapping[int, bytes]) -> bytes:
    """The bytes of a frame, after checking that they are those that the journal saw."""
    number, seen = record.fields.get("number"), record.fields.get("jpeg")
    if not isinstance(number, int) or number not in pictures:
        raise BadInput(f"{record.ref}: expected picture {number} among those that were kept, which are {len(pictures)}")
    jpeg = pictures[number]
    if not isinstance(seen, dict) or hashlib.sha256(jpeg).hexdigest() != seen.get("sha256"):
        where = f"{pictures.where(number)}: " if isinstance(pictures, Pictures) else ""
        raise BadInput(f"{where}{record.ref}: expected the picture that the journal saw, got another one for number "
                       f"{number}")
    return jpeg


def entry_of(record: EntryRecord[Any], kinds: Registry, store: FrameStore | None = None) -> Entry[Any]:
    """An entry as it stood on the board, but for the bytes of a picture, which the journal does not keep.

    A locale frame comes from the store; without a store, the reference to it that the journal keeps is the value.

    Raises BadInput where the value is of a kind that is not known, or does not fit it.
    """
    value, ref = value_of(record, kinds, None, store), ref_of(record.ref)
    return Entry(ref.id, ref.revision, value, record.author, cycle_of_writing(record), refs_of(record.because))


def cycle_of_writing(record: EntryRecord[Any]) -> int:
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
