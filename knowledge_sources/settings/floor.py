"""Settings of the methods that see free floor (§4, §5)."""

from __future__ import annotations

from dataclasses import dataclass

from knowledge_sources.settings.setting import setting


@dataclass(frozen=True, slots=True)
class FloorSettings:
    """The numbers of the methods that see free floor, with a camera or range sensors."""

    # Which parts are used
    use_appearance: bool = setting(
        True, "yes/no", "What does not look like the floor is a thing on it.", "engineering judgement")
    use_parallax: bool = setting(
        True, "yes/no", "Two pictures tell whether it stands up from the floor or lies flat on it.",
        "engineering judgement")
    use_ranges: bool = setting(
        True, "yes/no", "Range sensors tell of free floor too, where the robot has any.", "engineering judgement")

    # How far
    max_untold_m: float = setting(
        0.15, "m", "Depth of floor beside the model's own parts that is taken to be free, though its looks tell nothing"
        " there.", "engineering judgement")
