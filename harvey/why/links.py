"""Links between entries: what rests on what, and the few ways through that web that explanations take."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator

from harvey.run_files.records import EntryRecord
from harvey.why.history import History

FAR = 3000
"""So many entries are looked at for the nearest of a kind."""
STRANGE = (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError)
"""What reading a value raises that has other fields than this version writes."""
REVISIONS = 2000
"""So many revisions of a belief are looked back for where it began."""


def words(name: str) -> str:
    """``milestone_judge`` as people say it."""
    return name.replace("_", " ")


def reason(history: History, record: EntryRecord, type: str) -> EntryRecord | None:
    """The first entry of a type that an entry rests on directly."""
    refs = (ref for ref in record.because if ref.startswith(type + "-"))
    return next((found for ref in refs if (found := history.entry(ref)) is not None), None)


def within(history: History, record: EntryRecord) -> Iterator[EntryRecord]:
    """An entry and what it rests on, nearest first, each once; not more than FAR."""
    known, queue = {record.ref}, deque([record])
    for _ in range(FAR):
        if not queue:
            return
        one = queue.popleft()
        yield one
        for ref in one.because:
            if ref not in known and (below := history.entry(ref)) is not None:
                known.add(ref)
                queue.append(below)


def nearest(history: History, record: EntryRecord, types: Iterable[str]) -> EntryRecord | None:
    """The entry of one of these types that is fewest steps down ``because``; the entry itself counts."""
    wanted = frozenset(types)
    return next((one for one in within(history, record) if one.type in wanted), None)


def tracks_of(history: History, belief: EntryRecord) -> EntryRecord | None:
    """The landmarks that corrected a belief: they were written in the same act."""
    here = [r for r in history.written_by(belief.cycle) if r.type == "Tracks" and r.author == belief.author]
    return here[0] if here else reason(history, belief, "Tracks")


YAW_CALIBRATOR = "yaw_calibrator"
"""It turns a belief after a milestone, and tells nothing of where that is from."""


def anchor_of(history: History, belief: EntryRecord) -> EntryRecord | None:
    """The revision with which a belief began that was carried on by wheels and landmarks since."""
    id, _, revision = belief.ref.rpartition(".")
    first = int(revision) if revision.isdecimal() else 0
    for back in range(first, max(-1, first - REVISIONS), -1):
        found = history.entry(f"{id}.{back}")
        if found is None or (found.value["basis"] not in ("tracks", "odometry") and found.author != YAW_CALIBRATOR):
            return found
    return None
