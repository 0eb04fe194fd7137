"""Differences: evidence that model, belief and senses do not explain, and the rivals that would explain it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from blackboard import inference
from world_models import words

LAST_EVIDENCE = 64
"""The newest evidence that stays on the board; what it said stays in the difference."""

RivalKind = Literal[
    "chance", "thing", "jamb", "leaf", "wall", "dirt", "still camera", "late pictures", "lens", "focal length",
    "mounting", "wheels", "turns", "odometry", "bumper", "lamp", "cover", "exposure",
    "elsewhere", "pushed", "mover",
]
SENSES: frozenset[RivalKind] = frozenset({
    "dirt", "still camera", "late pictures", "lens", "focal length", "mounting", "wheels", "turns", "odometry",
    "bumper", "cover", "exposure"})
"""Rivals by which not the building or the belief is wrong, but a sense is."""

MISLEADING: frozenset[RivalKind] = frozenset({"still camera", "late pictures", "lens"})
"""Senses that tell wrong places, of which nothing is learnt on the way."""

TOLD_BY: Mapping[RivalKind, str] = {
    "thing": "a look past it from the side", "jamb": "a look along its wall", "leaf": "a look from before its door",
    "wall": "looks at other walls", "dirt": "a look in another direction, where dirt keeps its pixels",
    "still camera": "a picture after a turn", "late pictures": "a picture after a turn, and one long after it",
    "lens": "edges near the rim of the picture", "focal length": "the same edges from nearer and from further away",
    "mounting": "looks at near floor and far walls", "wheels": "another way between two sure places",
    "odometry": "motions of other lengths", "bumper": "a free motion", "lamp": "a picture in another room",
    "cover": "a picture in another room", "exposure": "a picture in another room",
    "elsewhere": "what can be seen from here alone", "pushed": "another look from here, and one from further on",
    "mover": "the same look a second later",
}
"""What would tell a rival from the others."""

MODEL = "the model of the building"
"""What differs where walls and doors stand elsewhere in general, or the camera makes it seem so."""
DOORS = "the doors of the building"
"""What differs where doors stand beside in general: each of them tells of the others."""
SURE = 0.95
"""A rival that is so probable is what the difference is taken for."""


@dataclass(frozen=True, slots=True)
class Explanation:
    """What one rival makes of some evidence.

    Attributes:
        kind: which rival it is.
        what: it in words, as ``a jamb of bedroom-door that stands 9 cm beside``.
        log_ratio: by how much the evidence is likelier with it than by what nobody has thought of [log].
        off, sigma: how far something is from where the model has it, or from what is stated of a sense, and its
            standard deviation, in SI units; 0 where it has no size.
    """

    kind: RivalKind
    what: str
    log_ratio: float
    off: float = 0.0
    sigma: float = 0.0


@inference(keep=LAST_EVIDENCE)
@dataclass(frozen=True, slots=True)
class Evidence:
    """What was seen, felt or counted, and is not as expected; it is posted once, unexplained.

    Attributes:
        about: what differs; evidence of one name is of one difference, as ``camera``, ``bedroom-door``.
        shows: what was seen, in words.
        explanations: what each rival makes of it; a rival that is not named has no opinion.
        x_m, y_m, heading_rad: from where [world].
        apart_m, apart_rad: evidence from so far apart, or by such a turn, is independent; where apart_m is 0
            it has nothing in common with any other.
        seen_s: by the body's clock.
    """

    about: str
    shows: str
    explanations: tuple[Explanation, ...]
    x_m: float
    y_m: float
    heading_rad: float
    apart_m: float
    apart_rad: float
    seen_s: float

    def sentence(self) -> str:
        rivals = ", ".join(f"{e.what} ({e.log_ratio:+.1f})" for e in self.explanations)
        return f"{self.about}: {self.shows}; explained by {rivals}; at {self.seen_s:.1f} s"


@dataclass(frozen=True, slots=True)
class Rival:
    """One explanation of a difference, by all of its evidence.

    Attributes:
        kind, what: as in :class:`Explanation`, by the evidence that is surest of its size; off, sigma: by all of it.
        log_odds: prior and evidence together, against what nobody has thought of.
        p: its probability among all rivals.
    """

    kind: RivalKind
    what: str
    log_odds: float
    p: float
    off: float = 0.0
    sigma: float = 0.0


@inference()
@dataclass(frozen=True, slots=True)
class Difference:
    """What differs from model, belief or sensor model, and the rivals that compete to explain it.

    Attributes:
        about: what differs.
        rivals: the likeliest first.
        counted: the evidence that counts, as it was posted.
        seen_s: of the last evidence, by the body's clock.
    """

    about: str
    rivals: tuple[Rival, ...]
    counted: tuple[Evidence, ...]
    seen_s: float

    @staticmethod
    def unknown(about: str) -> Difference:
        """A difference of which nothing is known yet."""
        return Difference(about, (), (), 0.0)

    @property
    def leader(self) -> Rival:
        return self.rivals[0]

    @property
    def is_sure(self) -> bool:
        """Whether its leader is sure, and more than chance."""
        return self.leader.p >= SURE and self.leader.kind != "chance"

    @property
    def is_of_sense(self) -> bool:
        """Whether a sense is surely what is wrong."""
        return self.is_sure and self.leader.kind in SENSES

    @property
    def p_misled(self) -> float:
        """The probability that a sense tells wrong places."""
        return math.fsum(rival.p for rival in self.rivals if rival.kind in MISLEADING)

    def find(self, kind: RivalKind) -> Rival | None:
        """The rival of a kind; None where nothing spoke of it."""
        return next((rival for rival in self.rivals if rival.kind == kind), None)

    def odds_of(self, kind: RivalKind) -> float:
        """The log odds of a rival; even where nothing spoke of it."""
        rival = self.find(kind)
        return 0.0 if rival is None else rival.log_odds

    def odds_in_words(self) -> str:
        """``a jamb of bedroom-door that stands 9 cm beside 92%, a thing 6%, dirt on the lens 2%``."""
        return ", ".join(f"{rival.what} {rival.p:.0%}" for rival in self.rivals if rival.p >= 0.005)

    def apart_in_words(self) -> str:
        """What would tell the two likeliest rivals apart; "" where one is sure, or nothing would."""
        two = () if self.leader.p >= SURE else self.rivals[:2]
        return " or ".join(TOLD_BY[rival.kind] for rival in two if rival.kind in TOLD_BY)

    def sentence(self) -> str:
        count, would = words.count(len(self.counted), "look"), self.apart_in_words()
        return (f"{self.about} differs: {self.odds_in_words()}; by {count}, the last: {self.counted[-1].shows}; at"
                f" {self.seen_s:.1f} s{'; to be told apart by ' * bool(would)}{would}")
