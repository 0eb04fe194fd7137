"""``make search``: other draws of the laws than yesterday's, file by file in an order of chance, for so many minutes.

hypothesis keeps what failed in ``.hypothesis`` and tries it first: so the files that failed the last time come first.
"""

from __future__ import annotations

import argparse
import random
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FAILED = ROOT / ".hypothesis" / "failed.txt"
"""The files of laws that failed, a line each."""


def main() -> int:
    parser = argparse.ArgumentParser(description="Other draws of the laws than yesterday's.")
    parser.add_argument("--minutes", type=float, default=10.0)
    end_s = time.monotonic() + 60.0 * parser.parse_args().minutes
    known = FAILED.read_text("utf-8").splitlines() if FAILED.exists() else []
    files = [str(path.relative_to(ROOT)) for path in sorted((ROOT / "tests" / "laws").rglob("test_laws_*.py"))
             if "@given" in (text := path.read_text("utf-8")) or "StateMachine" in text]
    random.shuffle(files)
    failed, tried = list[str](), set[str]()
    for name in sorted(files, key=lambda name: name not in known):
        left_s = end_s - time.monotonic()
        if left_s <= 0.0:
            break
        command = [sys.executable, "-m", "pytest", "-m", "not slow", "--hypothesis-profile=search", "--tb=short", name]
        try:
            failed += [name] * (subprocess.run(command, cwd=ROOT, check=False, timeout=left_s).returncode == 1)
        except subprocess.TimeoutExpired:
            break
        tried.add(name)
    failed += [name for name in known if name not in tried]
    FAILED.parent.mkdir(exist_ok=True)
    FAILED.write_text("".join(f"{name}\n" for name in failed), "utf-8")
    print(f"{len(tried)} of {len(files)} files of laws were tried, {len(failed)} fail", *failed, sep="\n")
    return int(bool(failed))


if __name__ == "__main__":
    raise SystemExit(main())
