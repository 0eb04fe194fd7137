"""The libraries use the same instructions on every processor that has them, whatever else it has."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping

import pytest
from hypothesis import given
from hypothesis import strategies as st

import logs.decided_by as subject
from elsewhere import ROOT
from logs.decided_by import AVX2, COMMON, NO_AVX512, ONE_THREAD, arithmetic, instructions

FLAGS = st.frozensets(st.sampled_from(["sse4_2", "avx", "avx2", "fma", "avx512f", "avx512_fp16", "amx_tile", "asimd"]))
ASKED = """
import json
import harvey
import cv2, numpy, scipy.linalg
from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__
from threadpoolctl import threadpool_info
from logs.decided_by import arithmetic
print(json.dumps({
    "blas": sorted({(of["architecture"], of["num_threads"]) for of in threadpool_info() if of["user_api"] == "blas"}),
    "numpy": [name for name in __cpu_dispatch__ if __cpu_features__[name]],
    "opencv": cv2.getCPUFeaturesLine(), "ipp": cv2.ipp.getIppVersion(), "threads": cv2.getNumThreads(),
    "arithmetic": arithmetic(),
}))
"""


def unsettled() -> dict[str, str]:
    """The environment of somebody who has set none of this."""
    ours = {**ONE_THREAD, **AVX2, **NO_AVX512}
    return {name: value for name, value in os.environ.items() if name not in ours}


def asked(program: str, more: Mapping[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", program], cwd=ROOT, env=unsettled() | dict(more or {}), check=True,
                          capture_output=True, text=True, timeout=120)


@given(FLAGS)
def test_a_processor_is_never_told_to_use_what_it_lacks(flags: frozenset[str]) -> None:
    told = instructions(flags)
    assert not AVX2.keys() & told.keys() or {"avx2", "fma"} <= flags
    assert not NO_AVX512.keys() & told.keys() or "avx512f" in flags


@given(FLAGS, FLAGS)
def test_processors_with_avx2_use_the_same(one: frozenset[str], other: frozenset[str]) -> None:
    """What has AVX-512 does without; what has none is not told so, which changes nothing."""
    def used(flags: frozenset[str]) -> tuple[object, bool]:
        told = instructions(flags)
        return {name: told.get(name) for name in AVX2}, "avx512f" in flags and not NO_AVX512.items() <= told.items()

    has = {"avx2", "fma"}
    assert used(one | has) == used(other | has) == (dict(AVX2), False)


def test_the_libraries_do_as_they_are_told() -> None:
    """They say themselves what they chose, and grumble at nothing."""
    if arithmetic() != COMMON:
        pytest.skip(f"this processor ({arithmetic()}) is none of the {COMMON}, or the environment says otherwise")
    done = asked(ASKED)
    chosen = json.loads(done.stdout)
    assert chosen["arithmetic"] == COMMON
    assert chosen["blas"] == [["Haswell", 1]]
    assert chosen["numpy"] == ["X86_V3"]
    assert "*AVX2" in chosen["opencv"]
    assert not [word for word in chosen["opencv"].split() if word.startswith("*AVX512") and not word.endswith("?")]
    assert "AVX2" in chosen["ipp"]
    assert chosen["threads"] == 1
    assert done.stderr == ""


def test_what_the_environment_says_already_stays() -> None:
    done = asked("import os, harvey; print(os.environ['OPENBLAS_CORETYPE'])", {"OPENBLAS_CORETYPE": "Nehalem"})
    assert done.stdout == "Nehalem\n"


def test_where_a_library_calculates_already_nothing_is_half_said() -> None:
    done = asked("import numpy, harvey, os; from logs.decided_by import *\n"
                 "print(sorted({**AVX2, **NO_AVX512}.keys() & os.environ.keys()), arithmetic())\n"
                 "print(all(os.environ[name] == '1' for name in ONE_THREAD))")
    said, _, rest = done.stdout.partition("] ")
    name, threads = rest.splitlines()
    assert said == "["
    assert name != COMMON
    assert threads == "True"


def test_a_processor_that_nothing_tells_of_is_told_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(subject, "CPUINFO", ROOT / "no such file")
    assert subject.instructions(subject._flags()) == {}
    assert arithmetic() not in ("", COMMON)
