"""By which code and on what processor a run is decided: two names for a run to tell, and what makes both the same.

The version stays the same while a program is worked on; what the files say does not. Counted are the mechanism, the
models and the knowledge sources, and the wiring that chooses them: a run is its observations and what these do
with them.

OpenBLAS, numpy, OpenCV and Intel's IPP within it look at what the processor can do, and choose: with broader registers
sums are added in another order, and a last digit comes out another. In a mission that is another decision a minute
later. So on every x86-64 processor with AVX2 and FMA they may use these and no more, though it have AVX-512 as well. On
any other, as an ARM, they choose for themselves: a run is the same each time there, and may differ from one made
elsewhere. One thread for linear algebra and for pictures: faster for matrices as small as ours and where every core has
a mission of its own, and the order of additions never varies.
"""

from __future__ import annotations

import hashlib
import os
import platform
import sys
from collections.abc import Mapping
from functools import cache
from importlib.metadata import Distribution
from pathlib import Path

import blackboard

DECIDING: Mapping[str, tuple[str, ...]] = {
    "blackboard": (".py",), "world_models": (".py",), "knowledge_sources": (".py", ".toml"),
}
"""The packages that decide, with the endings of their files; a run names its world's bytes itself."""
WIRING = "harvey/wiring.py"
"""The file that finds the knowledge sources."""
DIGITS = 16


@cache
def deciding_code() -> str:
    """The first digits of a SHA-256 of what decides; it takes some milliseconds, once a process."""
    return read_code_in(Path(__file__).parents[1], Path(blackboard.__file__).parents[1])


def read_code_in(root: Path, board: Path | None = None) -> str:
    """The same of a program elsewhere, whose board may be somewhere else again. Raises OSError."""
    files = {WIRING: f"{root}/{WIRING}"}
    for package, endings in DECIDING.items():
        files |= files_in(board if board and package == "blackboard" else root, package, endings)
    return digest_of(files)


def digest_of(files: Mapping[str, str]) -> str:
    """Of files' names and contents, in the order of their names and whatever the line ends. Raises OSError."""
    said = hashlib.sha256()
    for name, path in sorted(files.items()):
        with open(path, "rb") as file:
            text = file.read().replace(b"\r\n", b"\n")
        said.update(f"{name} {len(text)}\n".encode() + text)
    return said.hexdigest()[:DIGITS]


def files_in(root: Path, package: str, endings: tuple[str, ...]) -> dict[str, str]:
    """Where they are, by their names relative to the root, with slashes on any system."""
    paths = [f"{folder}/{name}" for folder, _, names in os.walk(f"{root}/{package}") for name in names]
    return {path[len(str(root)) + 1 :].replace(os.sep, "/"): path for path in paths if path.endswith(endings)}


ONE_THREAD: Mapping[str, str] = dict.fromkeys(
    ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM"), "1")
AVX2: Mapping[str, str] = {"OPENBLAS_CORETYPE": "Haswell", "OPENCV_IPP": "avx2"}
"""What makes OpenBLAS and IPP use AVX2: a processor without it would stumble over the first product of matrices."""
NO_AVX512: Mapping[str, str] = {
    "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR", "OPENCV_CPU_DISABLE": "AVX512-SKX",
}
"""What keeps numpy and OpenCV from using more. Where there is no more to use they would warn; it is not said then."""
COMMON = "x86-64 with AVX2"
"""The name of the arithmetic that all such processors share."""
CALCULATE = ("numpy", "scipy", "cv2")
LIBRARIES = ("numpy", "opencv-python-headless", "scipy", "numba", "shapely")
"""Their packages, and those of others that decide: another version may add in another order."""
CPUINFO = Path("/proc/cpuinfo")


@cache
def calculating_libraries() -> Mapping[str, str]:
    """The versions of :data:`LIBRARIES` that are installed, by name."""
    return {name: found.version for name in LIBRARIES for found in Distribution.discover(name=name)}


def settle() -> None:
    """Tell the libraries by the environment; what it says already stays.

    They ask it when they are first imported. Where one of them is already, nothing is said of instructions: half of
    them would use these, half others, and the run would be named after neither.
    """
    late = any(name in sys.modules for name in CALCULATE)
    for name, value in {**ONE_THREAD, **({} if late else instructions(_flags()))}.items():
        os.environ.setdefault(name, value)


def instructions(flags: frozenset[str]) -> dict[str, str]:
    """Variables of the environment that choose the instructions, for a processor with these flags of Linux."""
    if not {"avx2", "fma"} <= flags:
        return {}
    return {**AVX2, **(NO_AVX512 if "avx512f" in flags else {})}


def arithmetic() -> str:
    """Whose results these are, for a run to tell: :data:`COMMON`, or else the processor by its name."""
    chosen = instructions(_flags())
    if chosen and all(os.environ.get(name) == value for name, value in chosen.items()):
        return COMMON
    return f"{platform.machine()} {_cpuinfo().get('model name', '')}".strip()


def _flags() -> frozenset[str]:
    return frozenset(_cpuinfo().get("flags", "").split())


def _cpuinfo() -> dict[str, str]:
    """What Linux says of the first processor; nothing where there is no Linux."""
    try:
        first = CPUINFO.read_text(encoding="utf-8", errors="replace").partition("\n\n")[0]
    except OSError:
        return {}
    parted = (line.partition(":") for line in first.splitlines())
    return {key.strip(): value.strip() for key, _, value in parted}
