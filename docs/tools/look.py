"""Looking at a recording without a screen: pictures of the viewer at given cycles, and what its views complain of.

    python -m docs.tools.look runs/x/recording.rrd out/ 1 50 100
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rerun.experimental import ViewerClient

from logs.run_errors import RecordingError

LOCALHOST = "127.0.0.1"
START_S, SETTLE_S, ATTEMPTS = 6.0, 2.0, 10

NEEDS = "a headless viewer needs a graphics driver; on Debian: apt-get install mesa-vulkan-drivers libvulkan1"


def look(recording: Path, folder: Path, cycles: Sequence[int]) -> list[str]:
    """Save ``<folder>/cycle-<n>.png`` for each cycle; the warnings and errors that views reported on the way.

    Raises:
        RecordingError: there is no such file, or the viewer cannot start.
    """
    if not recording.is_file():
        raise RecordingError(f"{recording}: expected a recording, got no such file")
    folder.mkdir(parents=True, exist_ok=True)
    reports: dict[str, None] = {}
    with viewer() as client:
        client.open(str(recording.resolve()))
        time.sleep(START_S)
        for cycle in cycles:
            _visit(client, cycle, folder / f"cycle-{cycle}.png")
            reports |= dict.fromkeys(complaints(client))
    return list(reports)


@contextmanager
def viewer() -> Iterator[Any]:
    """A viewer without a window, which only this machine can reach; it ends with the block.

    Raises:
        RecordingError: it cannot start.
    """
    port = str(_free_port())
    command = [_executable(), "--headless", "--hide-welcome-screen", "--bind", LOCALHOST, "--port", port]
    try:
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, process_group=0)
    except OSError as error:
        raise RecordingError(f"the viewer cannot start ({error.strerror}); {NEEDS}") from None
    try:
        client = _connect(port)
        _await(client)
        yield client
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)  # its launcher leaves the viewer itself behind when only it ends
        process.wait()


def _connect(port: str) -> Any:
    """Raises RecordingError where the viewer does not answer."""
    for _ in range(ATTEMPTS):
        try:
            return ViewerClient(f"rerun+http://{LOCALHOST}:{port}/proxy")
        except (RuntimeError, OSError, ValueError) as error:
            last = str(error).strip().splitlines()[0]
            time.sleep(1.0)
    raise RecordingError(f"the viewer cannot start ({last}); {NEEDS}")


def complaints(client: Any) -> list[str]:
    """What the views of the shown blueprint report: ``<view>: <severity>: <summary>``."""
    views = client.get_state().views
    return [f"{view.name}: {report.severity}: {report.summary}" for view in views for report in view.reports]


def _visit(client: Any, cycle: int, picture: Path) -> None:
    client.set_time("cycle", sequence=cycle, play_state="paused")
    time.sleep(SETTLE_S)
    client.save_screenshot(str(picture.resolve()))


def _await(client: Any) -> None:
    """Until it has drawn something: without a driver a viewer answers at first, and dies of its first frame."""
    for _ in range(ATTEMPTS):
        try:
            with TemporaryDirectory() as folder:
                client.save_screenshot(str(Path(folder).resolve() / "first.png"))
            return
        except Exception as error:  # the client's errors have no common type
            last = error
            time.sleep(1.0)
    raise RecordingError(f"the viewer draws nothing ({last}); {NEEDS}")


def _executable() -> str:
    """The viewer that is installed beside this Python, whether or not it is on the search path."""
    return shutil.which("rerun", path=str(Path(sys.executable).parent)) or "rerun"


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((LOCALHOST, 0))
        return int(probe.getsockname()[1])


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description="Pictures of a recording at given cycles.")
    parser.add_argument("recording", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("cycles", type=int, nargs="+")
    wanted = parser.parse_args()
    try:
        reports = look(wanted.recording, wanted.folder, wanted.cycles)
    except RecordingError as error:
        print(error, file=sys.stderr)
        return 2
    print("\n".join(reports) or "no view reports anything")
    return 1 if reports else 0


if __name__ == "__main__":
    sys.exit(main())
