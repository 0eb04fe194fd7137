"""Malformed world files: each must give a clear error, or a world that can be checked.

Words and lines of texts are deleted, doubled, swapped and replaced; values are made huge, tiny, negative, of another
type, or another name; compiled worlds lose and change bytes; building files (IndoorGML, IFC) are corrupted in the same
ways before import. A time limit per file finds endless loops.
"""

from __future__ import annotations

import re
import signal
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from types import FrameType

import numpy as np
from tqdm import tqdm

from experiments.report import Report
from harvey.campaign.workers import Killed, map_cases
from harvey.errors import BadInput
from world_models.building.checks import check_world
from world_models.files.toml.source import Source, WorldError
from world_models.files.world_files import compile_file, load_world, read_world

FILES, QUICK_FILES = 10_000, 400
CHUNK, QUICK_CHUNK = 100, 20
"""Files per trial of a worker."""
IFC_EVERY = 50
"""One file of this many is IFC: reading one takes a process of its own."""
SMALL, GML, IFC = (Path(__file__).with_name(f"malformed_small.{kind}").read_text("utf-8")
                   for kind in ("toml", "gml", "ifc"))
"""Small valid files that use what the loader and the importers read: a world, an IndoorGML and an IFC building."""
LIMIT_S = 30.0
"""Time limit of a file, generous for a busy machine."""

TOKEN = re.compile(r'"[^"\n]*"|[\w.+-]+|[^\w\s]|\s+')
JUNK = ("-1", "0", "1e400", "1e-300", "nan", "inf", "-3.5", "99999999", "9" * 400, "true", "[]", "{}", '""', "'''", "=",
        "1979-05-27", "\\", "\x00", "\u202e", "[[", "]]", "[locales]", "\n\n", "#", '"north"', '"kitchen"', "[0, 0, 0]",
        '"side-1"', '"feet"', "0.0001", "100000", "[" * 200)


def run(quick: bool, seed: int) -> Report:
    """Corrupt, read and check files."""
    files, chunk = (QUICK_FILES, QUICK_CHUNK) if quick else (FILES, CHUNK)
    results = list(_judge_files(files, chunk, seed))
    tally: dict[str, Counter[str]] = {}
    for result in results:
        tally.setdefault(result.corruption, Counter())[result.verdict.split(":")[0]] += 1
    wrong = [f"file {number} ({result.corruption}): {result.verdict}" for number, result in enumerate(results)
             if result.verdict.startswith(("traceback", "hang", "unclear"))]
    rows = tuple((name, sum(seen.values()), seen["error"], seen["sound"], seen["faults"], seen["traceback"],
                  seen["hang"], seen["unclear"]) for name, seen in tally.items())
    return Report(
        "Malformed world and building files",
        ("corrupted in", "files", "clear error", "sound", "with faults", "traceback", "hang", "unclear"), rows,
        notes=(f"{files} files, seed {seed}; the slowest took {max(result.seconds for result in results):.2f} s (limit"
               f" {LIMIT_S:.0f} s).",
               "words, lines, values, characters: of a world's text; bytes: of a compiled world (SQLite); IndoorGML,"
               " IFC: building files, corrupted in words and lines, then imported."
               + ("" if _with_ifc() else " No IFC file was tried: harvey-buildings is not installed."),
               "with faults: a world that was read, whose check names its faults with file and line.",
               "unclear: an error or fault that does not name the file, what was expected and what it got.",
               *wrong[:10]),
        claims=((f"all {files}: a clear error or a checked world, never a traceback or a hang", not wrong),),
    )


@dataclass(frozen=True, slots=True)
class FileResult:
    """Result of one file: how it was corrupted, its verdict, and the time taken [s]."""

    corruption: str
    verdict: str
    seconds: float


def _judge_files(files: int, chunk: int, seed: int) -> Iterator[FileResult]:
    """Judge all files in worker processes; results come in order."""
    parts = [range(first, min(first + chunk, files)) for first in range(0, files, chunk)]
    known: dict[int, list[FileResult]] = {}
    with tqdm(total=files, unit="file", file=sys.stderr, disable=not sys.stderr.isatty(), leave=False) as bar:
        for place, found in map_cases(partial(judge_files, seed=seed), parts):
            if isinstance(found, Killed):
                raise BadInput(f"case {place}: {found.text}")
            known[place] = found.value
            bar.update(len(found.value))
    for place in range(len(parts)):
        yield from known[place]


def judge_files(numbers: Sequence[int], seed: int) -> list[FileResult]:
    """Judge the files with these numbers."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        sound = _compile_world(Path(folder))
        for number in numbers:
            name, suffix, corrupt = choose_corruption(number)
            content = corrupt(np.random.default_rng([seed, number]), sound)
            began = time.perf_counter()
            verdict = judge_file(content, Path(folder), suffix)
            found.append(FileResult(name, verdict, time.perf_counter() - began))
    return found


def _with_ifc() -> bool:
    return _with_buildings() and find_spec("ifcopenshell") is not None


def _with_buildings() -> bool:
    """Whether the extra that reads building files is installed."""
    return find_spec("harvey_buildings") is not None


Corruption = Callable[[np.random.Generator, bytes], str | bytes]


def choose_corruption(number: int) -> tuple[str, str, Corruption]:
    """Choose how the file of this number is corrupted: name, file ending, and function."""
    if number % IFC_EVERY == IFC_EVERY - 1 and _with_ifc():
        return CORRUPTIONS[-1]
    return CORRUPTIONS[number % (len(CORRUPTIONS) - (1 if _with_buildings() else 2))]


class _TooLongError(BaseException):
    """The time limit; like KeyboardInterrupt it passes every ``except Exception``."""


@contextmanager
def _time_limit(seconds: float) -> Iterator[None]:
    """Raise _TooLongError after a time; works in the main thread only."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(_signal: int, _frame: FrameType | None) -> None:
        raise _TooLongError

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def judge_file(content: str | bytes, folder: Path, suffix: str = ".toml") -> str:
    """Read a file: ``error``, ``sound``, ``faults``; or a failure: ``traceback: ...``, ``hang``, ``unclear: ...``."""
    try:
        with _time_limit(LIMIT_S):
            return _read(content, folder / f"world{suffix}")
    except WorldError as error:
        text = str(error)
        clear = "world." in text and "expected" in text and ("got" in text or suffix in BUILDINGS)
        return "error" if clear else f"unclear: {text}"
    except _TooLongError:
        return "hang"
    except Exception as error:
        return f"traceback: {error!r}"


def _read(content: str | bytes, path: Path) -> str:
    if isinstance(content, bytes):
        path.write_bytes(content)
        world = load_world(path)
        world.locales.values()
        faces, faults = world.faces, check_world(world)
        assert faces is not None
    elif path.suffix == ".toml":
        faults = check_world(read_world(Source.parse(content, path.name)))
    else:
        from harvey_buildings import import_building

        path.write_text(content, encoding="utf-8")
        faults = check_world(read_world(Source.parse(import_building(path).text, "world.toml")))
    unclear = [str(f) for f in faults if "expected" not in f.what or "got" not in f.what or not f.source]
    if unclear and not isinstance(content, bytes):
        return f"unclear: {unclear[0]}"
    return "faults" if faults else "sound"


def _compile_world(folder: Path) -> bytes:
    compile_file(Path(__file__).with_name("malformed_small.toml"), folder / "sound.world")
    return (folder / "sound.world").read_bytes()


def _words(text: str) -> Corruption:
    """Replace, delete, insert or swap words and signs."""
    def corrupt(rng: np.random.Generator, _sound: bytes) -> str:
        tokens = TOKEN.findall(text)
        for _ in range(int(rng.integers(1, 5))):
            at, other = (int(i) for i in rng.integers(len(tokens), size=2))
            match int(rng.integers(5)):
                case 0:
                    tokens[at] = JUNK[int(rng.integers(len(JUNK)))]
                case 1:
                    del tokens[at]
                case 2:
                    tokens.insert(at, JUNK[int(rng.integers(len(JUNK)))])
                case 3:
                    tokens[at], tokens[other] = tokens[other], tokens[at]
                case _:
                    tokens[at] = tokens[other]
        return "".join(tokens)

    return corrupt


def _lines(text: str) -> Corruption:
    """Delete, double or move lines, or cut off the end."""
    def corrupt(rng: np.random.Generator, _sound: bytes) -> str:
        lines = text.splitlines(keepends=True)
        for _ in range(int(rng.integers(1, 4))):
            at, other = (int(i) for i in rng.integers(len(lines), size=2))
            match int(rng.integers(4)):
                case 0:
                    del lines[at]
                case 1:
                    lines.insert(other, lines[at])
                case 2:
                    lines[at], lines[other] = lines[other], lines[at]
                case _:
                    lines = lines[: max(2, at)]
        return "".join(lines)

    return corrupt


def _either(one: Corruption, other: Corruption) -> Corruption:
    return lambda rng, sound: (one if rng.random() < 0.7 else other)(rng, sound)


def _values(rng: np.random.Generator, _sound: bytes) -> str:
    """Replace numbers by numbers and names by names: the text stays TOML."""
    numbers = list(re.finditer(r"(?<![\w.\"-])-?\d+(?:\.\d+)?(?![\w\"])", SMALL))
    names = list(re.finditer(r'"[\w-]+"', SMALL))
    text = SMALL
    picks = [numbers[int(i)] for i in rng.integers(len(numbers), size=int(rng.integers(1, 4)))]
    picks += [names[int(i)] for i in rng.integers(len(names), size=int(rng.integers(0, 2)))]
    for found in sorted({p.start(): p for p in picks}.values(), key=lambda p: -p.start()):
        if found.group().startswith('"'):
            new = names[int(rng.integers(len(names)))].group()
        else:
            value = float(found.group())
            new = repr((value * 10.0 ** rng.integers(-3, 4), -value, value + rng.normal(), 0.0, round(value * 2),
                        value * (1 + 1e-9))[int(rng.integers(6))])
        text = text[: found.start()] + new + text[found.end() :]
    return text


def _characters(rng: np.random.Generator, _sound: bytes) -> str:
    """Change single characters."""
    text = list(SMALL)
    for _ in range(int(rng.integers(1, 8))):
        text[int(rng.integers(len(text)))] = chr(int(rng.choice([rng.integers(32, 127), rng.integers(1, 0xD7FF)])))
    return "".join(text)


def _bytes(rng: np.random.Generator, sound: bytes) -> bytes:
    """Change bytes of a compiled world, or cut it off."""
    content = bytearray(sound)
    if rng.random() < 0.1:
        return bytes(content[: int(rng.integers(len(content)))])
    for _ in range(int(rng.integers(1, 40))):
        content[int(rng.integers(len(content)))] = int(rng.integers(256))
    return bytes(content)


def _building(text: str) -> Corruption:
    """Corrupt a building file in its words or its lines, one line per element."""
    return _either(_words(text), _lines(text.replace("><", ">\n<")))


CORRUPTIONS: tuple[tuple[str, str, Corruption], ...] = (
    ("words", ".toml", _words(SMALL)), ("lines", ".toml", _lines(SMALL)), ("values", ".toml", _values),
    ("characters", ".toml", _characters), ("bytes", ".world", _bytes), ("IndoorGML", ".gml", _building(GML)),
    ("IFC", ".ifc", _building(IFC)))
"""Building files are the last two, IFC the last."""
BUILDINGS = (".gml", ".ifc")
