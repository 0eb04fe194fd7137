"""Open a recorded run: its decisions, its entries with typed values, its pictures, and how far it was off the truth."""

from collections import Counter
from pathlib import Path

import harvey
from world_models.entries import Certificate

OUT = Path("runs") / "example"

if not OUT.exists():
    harvey.run("forty-foot-hallway", seed=1, out=OUT)
run = harvey.open_run(OUT)

acts = Counter(decision.chosen.source for decision in run.decisions() if decision.chosen)
print("who acted:", ", ".join(f"{name} {count}" for name, count in acts.most_common(5)))

for entry in run.entries(Certificate):
    print(f"cycle {entry.cycle}: {entry.value.verdict}, probability of a wrong pose {entry.value.p_false:.1g}")

believed = {point.cycle: point.pose for point in run.believed_track()}
errors_m = [believed[p.cycle].distance_to(p.pose) for p in run.true_track() if p.cycle in believed]
print(f"the belief was off by {1000 * max(errors_m):.0f} mm at most")

picture = next(run.pictures())
print(f"{picture.entry} at {picture.time_s:.1f} s has {picture.pixels().shape} pixels")
