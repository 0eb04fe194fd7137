"""A knowledge source of one's own with its own kind of entry, in a mission: it notes the largest correction so far."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import harvey
from harvey import Change, Effect, Entry, Level, Post, Revise, Revised, View, Watch
from world_models.entries import Hypothesis

OUT = Path("runs") / "largest-correction"


@harvey.inference()
@dataclass(frozen=True)
class LargestDoubt:
    """The largest standard deviation of the robot's place so far [m]."""

    sigma_m: float

    def sentence(self) -> str:
        return f"the belief was never less sure than {1000 * self.sigma_m:.0f} mm"


class DoubtKeeper(harvey.KnowledgeSource):
    """Notes the largest doubt about the robot's place."""

    level = Level.ACTION
    on = (Watch(Hypothesis, (Revised,), lambda hypothesis: hypothesis.is_held),)
    priority = 0.05
    writes = (LargestDoubt,)

    def bind(self, view: View, trigger: Change) -> Entry[Hypothesis] | None:
        known = view.latest(LargestDoubt)
        return trigger.entry if known is None or trigger.entry.value.sigma_m > known.value.sigma_m else None

    def act(self, view: View, case: Entry[Hypothesis]) -> Iterable[Effect]:
        known, doubt = view.latest(LargestDoubt), LargestDoubt(case.value.sigma_m)
        yield Post(doubt, (case,)) if known is None else Revise(known, doubt, (case,))


result = harvey.run("forty-foot-hallway", seed=1, out=OUT, knowledge_sources=[DoubtKeeper])
run = harvey.open_run(OUT, knowledge_sources=[DoubtKeeper])
last = list(run.entries(LargestDoubt))[-1]
print(f"{result.outcome}; {last.value.sentence()}, in cycle {last.cycle} (because of {last.because[0]})")
print("replayed the same" if run.replay() is None else "replayed differently")
