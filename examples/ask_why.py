"""Ask a recorded run why: how it ended, one turn of the wheels, one cycle; and whether it decides the same again."""

from pathlib import Path

import harvey

OUT = Path("runs") / "example"

if not OUT.exists():
    harvey.run("forty-foot-hallway", seed=1, out=OUT)
run = harvey.open_run(OUT)

print(run.why())
print()
print(run.why("MotorCommand-5"))
print()
for story in run.stories(50):
    print(story.headline)
    for step in story.steps:
        print(f"  {step.label}: from {', '.join(step.refs)}")

first = run.replay()
print("replayed: every decision is the same" if first is None else f"replayed: cycle {first} is decided differently")
