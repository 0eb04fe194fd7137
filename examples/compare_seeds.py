"""Drive the same mission with several seeds and without the action level, and draw the errors beside each other."""

from pathlib import Path

import matplotlib

import harvey

matplotlib.use("Agg")
from matplotlib import pyplot as plt

SEEDS = range(3)
PICTURE = Path("runs") / "seeds.png"

tracks = {}
for name, settings in (("servoed", {}), ("unservoed", {"servo.action": False})):
    for seed in SEEDS:
        out = Path("runs") / f"{name}-{seed}"
        result = harvey.run("forty-foot-hallway", seed=seed, settings=settings, out=out)
        tracks[name, seed] = [point.pose for point in harvey.open_run(out).true_track()]
        strayed_mm = 1000 * (result.max_cross_track_m or 0.0)
        print(f"{name}, seed {seed}: {result.outcome}, strayed {strayed_mm:.0f} mm at most")

figure, axes = plt.subplots(figsize=(8, 3), layout="constrained")
for (name, _seed), poses in tracks.items():
    colour = "tab:blue" if name == "servoed" else "tab:orange"
    axes.plot([pose.x_m for pose in poses], [1000 * (pose.y_m - poses[0].y_m) for pose in poses], color=colour)
axes.set_xlabel("down the hallway [m]")
axes.set_ylabel("to the left of the start [mm]")
axes.set_title("blue: servoed at the action level; orange: not")
PICTURE.parent.mkdir(exist_ok=True)
figure.savefig(PICTURE)
print(f"drawn in {PICTURE}")
