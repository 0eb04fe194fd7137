"""Inner loops, compiled by numba: loaded from its cache without its compiler."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar, cast

from numba import njit
from numba.core.runtime.nrt import rtsys

F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """Decorator of a function that is compiled when it is first called with arguments of such types, and then kept."""
    dispatcher: Any = njit(cache=True, error_model="numpy")(function)
    if hasattr(dispatcher._cache, "_load_overload"):  # private to numba: another version of it loads in its own way
        dispatcher._cache.load_overload = partial(_load, dispatcher._cache)
    return cast("F", dispatcher)


def inlined(function: F) -> F:
    """Decorator of a function that only compiled ones call."""
    return cast("F", njit(cache=True, error_model="numpy", forceinline=True)(function))


def _load(cache: Any, signature: Any, target: Any) -> Any:
    """What the cache has for a signature, or None.

    numba's own way prepares the compiler first, whether there is anything to compile or not: half a second.
    What was compiled needs the run time only; the compiler prepares itself when it is called.
    """
    rtsys.initialize(target)
    with cache._guard_against_spurious_io_errors():
        return cache._load_overload(signature, target)
