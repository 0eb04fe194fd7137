"""Agents whose observations are a model's answers: asked once, recorded, and decided again without the model.

The model is a fake one here. A real one is called in the same place, in ``Model.answer``, and nowhere else.
"""

from pathlib import Path

from blackboard import History, Post, Revise, Scheduler, Watch, inference, observation, request, rule

OUT = Path("runs") / "recorded_model.jsonl"


@observation
class Task:
    text: str


@request
class Prompt:
    role: str
    text: str


@observation
class Reply:
    role: str
    text: str


@inference
class Draft:
    text: str
    is_accepted: bool = False


class Model:
    """The port: each prompt that a decision has made is answered once, after the decision was written down."""

    name = "model"

    def answer(self, change):
        prompt = change.entry.value
        if prompt.role == "writer":
            text = f"{prompt.text}: rain" if "again" not in prompt.text else "rain, then sun"
        else:
            text = "good" if "sun" in prompt.text else "again, with hope"
        yield Post(Reply(prompt.role, text), (change.entry,))


@rule(on=Task, writes=Prompt)
def asker(view, trigger):
    yield Post(Prompt("writer", trigger.entry.value.text), (trigger.entry,))


@rule(on=Watch(Reply, where=lambda reply: reply.role == "writer"), writes=(Draft, Prompt))
def writer(view, trigger):
    old, text = view.latest(Draft), trigger.entry.value.text
    draft = Post(Draft(text), (trigger.entry,)) if old is None else Revise(old, Draft(text), (trigger.entry,))
    yield draft
    yield Post(Prompt("critic", text), (draft,))


@rule(on=Watch(Reply, where=lambda reply: reply.role == "critic"), writes=(Draft, Prompt))
def editor(view, trigger):
    draft, verdict = view.latest(Draft), trigger.entry.value.text
    if verdict == "good":
        yield Revise(draft, Draft(draft.value.text, True), (trigger.entry, draft))
    else:
        yield Post(Prompt("writer", f"{draft.value.text}; {verdict}"), (trigger.entry, draft))


AGENTS = (asker, writer, editor)
history = History()
scheduler = Scheduler(AGENTS, ports=[Model()], sinks=[history])
scheduler.post([Post(Task("the weather"))], "user")
scheduler.run()
OUT.parent.mkdir(exist_ok=True)
history.save(OUT)
print(history.why("Draft-1"))

parted = History.read(OUT).replay(Scheduler(AGENTS))
print(f"decided again without the model: {'the same' if parted is None else f'different from cycle {parted} on'}")
