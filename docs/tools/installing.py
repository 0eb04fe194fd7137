"""pip with a line of progress, and nothing else unless it fails: ``python docs/tools/installing.py LOCK``.

Only the standard library is imported: nothing else is installed yet.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

PIP = [sys.executable, "-m", "pip", "install", "--disable-pip-version-check", "--no-compile", "--require-hashes",
       "--no-color", "--progress-bar", "off", "-r"]
FOUND = re.compile(r"^(?:Collecting|Requirement already satisfied:) ([\w.-]+)")
EVERY = 20
"""Where the output is no terminal, a line for so many packages."""


def main(lock: Path) -> int:
    """Install what a lock names; pip's exit code, and all that it said where that is not 0."""
    total = len(re.findall(r"^[\w.,\[\]-]+==", lock.read_text(encoding="utf-8"), re.MULTILINE))
    names, said = set[str](), []
    with subprocess.Popen([*PIP, str(lock)], text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as pip:
        for line in pip.stdout or ():
            said.append(line)
            if found := FOUND.match(line):
                names.add(found[1].lower())
                _tell(f"   {len(names)} of {total}: {found[1]}", len(names) % EVERY == 0)
            elif line.startswith("Installing collected"):
                _tell(f"   {len(names)} fetched, now they are unpacked", True)
    if sys.stdout.isatty():
        print("\r\033[K", end="", flush=True)
    if pip.returncode:
        print("".join(said), end="", file=sys.stderr)
    return pip.returncode


def _tell(text: str, is_due: bool) -> None:
    if sys.stdout.isatty():
        print(f"\r\033[K{text}", end="", flush=True)
    elif is_due:
        print(text, flush=True)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
