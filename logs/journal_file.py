"""The journal on disk: one decision a line, written before anything follows from it."""

from __future__ import annotations

from pathlib import Path

from blackboard import Decision, decision_line, is_request
from logs.disk import Appended

HELD_LINES = 64
"""So many decisions on which nothing rests outside the board are written together."""


def is_acted_on(decision: Decision) -> bool:
    """Whether a decision made or changed a request, on which a port will act."""
    return any(is_request(type(change.entry.value)) for change in decision.made)


class JournalFile:
    """A scheduler's sink that writes ``journal.jsonl``.

    The scheduler calls its sinks before a port sees the decision. When this returns:

    - a decision on which a port will act, or that took up an observation, is with the operating system, with all before
      it: nothing reaches the motors that is not written down, and a killed process takes no observation with it;
    - where ``sync`` is set, one on which a port will act is on the disk too: a power cut changes nothing about that;
    - any other decision follows from those before it and nothing has followed from it outside the board. It may be held
      back until the next of the other kinds, or until there are HELD_LINES; a killed process makes it again, the same.

    Measured on an ext4 disk: forcing takes 6 ms, writing alone 0.01 ms; two decisions and one picture an increment.
    """

    def __init__(self, path: Path, *, keep: int = 0, sync: bool = True) -> None:
        """Begin a new journal at ``path``, or go on with one behind its first ``keep`` bytes.

        Args:
            sync: force what a port will act on onto the disk before this sink returns.

        Raises OSError where the file cannot be written, or another process is writing it.
        """
        self._sync = sync
        self._held: list[str] = []
        self._last: tuple[Decision, str] | None = None
        self._file = Appended(path, "journal", keep=keep)

    def __call__(self, decision: Decision) -> None:
        """Write one line, or hold it back.

        Raises CannotWriteError where the file cannot be written any more, as when the disk is full; names the file.
        """
        self._held.append(self.line(decision))
        is_awaited = is_acted_on(decision)
        if is_awaited or decision.observed or len(self._held) >= HELD_LINES:
            self.flush()
        if is_awaited and self._sync:
            self._file.sync()

    def line(self, decision: Decision) -> str:
        """A decision's line, without its newline; the last one is remembered."""
        if self._last is None or self._last[0] is not decision:
            self._last = decision, decision_line(decision)
        return self._last[1]

    def flush(self) -> None:
        """Hand over what is held back to the operating system. Raises CannotWriteError; then it is held no more."""
        lines, self._held = self._held, []
        if lines:
            self._file.append("\n".join([*lines, ""]).encode())

    def close(self) -> None:
        """No more decisions. Raises CannotWriteError where the last ones cannot be written."""
        try:
            self.flush()
        finally:
            self._file.close()
