"""Kinds of entries: what each type of value is to the board, said once, where the type is defined.

``@request``, ``@observation`` and ``@inference`` mark a frozen dataclass as a kind of entry, and make one of a class
that is none yet. Everything that differs by kind follows from the mark: what ports are asked for, what is written
before they are asked, what is read back from a journal, how long an entry is kept, and how people read of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from types import ModuleType
from typing import Any, TypeVar, dataclass_transform, overload

T = TypeVar("T")

MARK = "KIND"  # the class attribute that holds the mark


class Role(Enum):
    """Where entries of a kind come from, and who acts on them."""

    REQUEST = "request"  # a rule writes it, and a port acts on it: it is in the journal before the port is asked
    OBSERVATION = "observation"  # from outside: from a port, from the user, or from what runs the program
    INFERENCE = "inference"  # a rule concludes it from other entries


def always(_value: Any) -> bool:
    return True


def never(_view: Any, _entry: Any) -> bool:
    return False


def nothing(_value: Any) -> Iterable[str]:
    return ()


@dataclass(frozen=True, slots=True)
class Kind:
    """What the board must know of a type of value.

    Attributes:
        role: request, observation or inference.
        keep: the newest postings, so many, always stay in memory; None: all of them do.
        when: of the older ones only those leave for which this holds; pure.
        unless: and of these, not those for which this holds of the view and the entry; pure.
        needs: ids of the entries that must stay in memory as long as one with this value does; pure.
        traced: whether each decision names the revisions of this kind that its act read.
    """

    role: Role
    keep: int | None = None
    when: Callable[[Any], bool] = always
    unless: Callable[[Any, Any], bool] = never
    needs: Callable[[Any], Iterable[str]] = nothing
    traced: bool = False


class NotAKindError(TypeError):
    """A type that was put on the board, watched or written without being marked as a kind of entry."""


@overload
def request(value_type: type[T], /) -> type[T]: ...
@overload
def request(**more: Any) -> Callable[[type[T]], type[T]]: ...
@dataclass_transform(frozen_default=True)
def request(value_type: type[T] | None = None, /, **more: Any) -> Any:
    """Marks what ports act on; ``more`` are the other attributes of :class:`Kind`."""
    return _mark(Kind(Role.REQUEST, **more), value_type)


@overload
def observation(value_type: type[T], /) -> type[T]: ...
@overload
def observation(**more: Any) -> Callable[[type[T]], type[T]]: ...
@dataclass_transform(frozen_default=True)
def observation(value_type: type[T] | None = None, /, **more: Any) -> Any:
    """Marks what comes from outside."""
    return _mark(Kind(Role.OBSERVATION, **more), value_type)


@overload
def inference(value_type: type[T], /) -> type[T]: ...
@overload
def inference(**more: Any) -> Callable[[type[T]], type[T]]: ...
@dataclass_transform(frozen_default=True)
def inference(value_type: type[T] | None = None, /, **more: Any) -> Any:
    """Marks what knowledge sources conclude."""
    return _mark(Kind(Role.INFERENCE, **more), value_type)


def kind_of(value_type: type[Any]) -> Kind:
    """The mark of a type. Raises NotAKindError."""
    kind = value_type.__dict__.get(MARK)
    if not isinstance(kind, Kind):
        raise NotAKindError(f"expected a kind of entry, got {value_type.__name__}: mark it with @request, @observation "
                            "or @inference (blackboard.kinds)")
    return kind


def is_kind(value_type: type[Any]) -> bool:
    """Whether a type is marked."""
    return isinstance(value_type.__dict__.get(MARK), Kind)


def is_request(value_type: type[Any]) -> bool:
    """Whether ports act on values of a type."""
    return kind_of(value_type).role is Role.REQUEST


def kinds_in(*modules: ModuleType) -> tuple[type[Any], ...]:
    """The marked types that modules define, in the order of their definition."""
    return tuple(value for module in modules for value in vars(module).values()
                 if isinstance(value, type) and value.__module__ == module.__name__ and is_kind(value))


class Registry(Mapping[str, type[Any]]):
    """The kinds of entries of one board, by name: as the journal names them."""

    def __init__(self, kinds: Iterable[type[Any]]) -> None:
        """Raises NotAKindError for an unmarked type, ValueError for two types of one name."""
        self._kinds: dict[str, type[Any]] = {}
        for value_type in kinds:
            kind_of(value_type)
            known = self._kinds.setdefault(value_type.__name__, value_type)
            if known is not value_type:
                raise ValueError(f"expected kinds of different names, got {known.__module__}.{known.__name__} and "
                                 f"{value_type.__module__}.{value_type.__name__}")

    def of_role(self, role: Role) -> tuple[type[Any], ...]:
        """The kinds of a role."""
        return tuple(value_type for value_type in self.values() if kind_of(value_type).role is role)

    def marks(self) -> Mapping[type[Any], Kind]:
        """What each type is marked with."""
        return {value_type: kind_of(value_type) for value_type in self.values()}

    def __getitem__(self, name: str) -> type[Any]:
        return self._kinds[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._kinds)

    def __len__(self) -> int:
        return len(self._kinds)


def _mark(kind: Kind, value_type: type[T] | None) -> Any:
    def mark(value_type: type[T]) -> type[T]:
        parameters = value_type.__dict__.get("__dataclass_params__")
        if parameters is None and "__annotations__" in value_type.__dict__:
            return mark(dataclass(frozen=True)(value_type))
        if parameters is None or not parameters.frozen:
            raise TypeError(f"expected a frozen dataclass, got {value_type.__name__}")
        setattr(value_type, MARK, kind)
        return value_type

    return mark if value_type is None else mark(value_type)
