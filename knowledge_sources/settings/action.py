"""Settings of the knowledge sources of the action level (§5)."""

from __future__ import annotations

from dataclasses import dataclass

from knowledge_sources.settings.setting import setting


@dataclass(frozen=True, slots=True)
class ActionSettings:
    """The numbers of the knowledge sources of the action level (§5)."""

    # Tolerance of the action level
    min_tolerance_px: float = setting(
        4.0, "px", "Floor of the tolerance in the image: what correlation alone may be wrong by.",
        "engineering judgement")
    tolerance_sigmas: float = setting(
        3.0, "1", "Standard deviations of the believed pose that the action level may correct.", "§3.2")

    # Motor
    lookahead_m: float = setting(
        1.2, "m", "Distance ahead on the line at which the motor steers (pure pursuit): two increments.",
        "engineering judgement")

    # Floor ahead: motor and path follower
    keeps_to_seen_floor: bool = setting(
        True, "yes/no", "Whether the robot drives only where it has seen the floor free; else it looks or creeps.",
        "§4")
    max_seen_age_s: float = setting(
        60.0, "s", "What was seen to be free longer ago must be seen again.", "engineering judgement")
    creep_speed_m_per_s: float = setting(
        0.09, "m/s", "Speed into floor that was not seen to be free.", "engineering judgement")
    max_creep_m: float = setting(
        0.6, "m", "Longest move at that speed before the next picture.", "engineering judgement")
    max_looks: int = setting(
        4, "count", "Most looks round on one leg.", "engineering judgement")

    # Correlator tracker
    max_misses: int = setting(
        2, "count", "A landmark that is not found so many times in a row is dropped.", "engineering judgement")
    min_expected_landmarks: int = setting(
        4, "count", "Fewest expected landmarks that can make a discrepancy.", "engineering judgement")
    min_agreeing_landmarks: int = setting(
        2, "count", "Fewest landmarks that must agree for the belief to be corrected by them; of those that were found"
        " alone, one in 17 was something else.", "34 of them, on drives to and fro in the Research Center")
    min_agreeing_part: float = setting(
        1.0 / 3.0, "1", "If a smaller part of the expected landmarks agrees, tracking has failed.",
        "engineering judgement")
    min_followed_landmarks: int = setting(
        4, "count", "With so many landmarks in the last tracked frame, the robot is taken to be still in its room.",
        "engineering judgement")

    # Obstacle finder
    obstacle_width_m: float = setting(
        0.45, "m", "Width and depth that something touched is taken to have.", "engineering judgement")

    min_thing_certainty: float = setting(
        0.5, "1", "What is seen on the floor with less certainty than this tells of no obstacle.",
        "engineering judgement")
    min_obstacle_certainty: float = setting(
        0.9, "1", "With this certainty an obstacle is there: by one sure picture, or by two unsure ones.",
        "engineering judgement")
    act_within_m: float = setting(
        0.7, "m", "What may stand in the next so much of the way is held to be there: nearer it is not seen at all.",
        "the picture's lower border shows floor 1.3 m ahead")
    max_obstacle_certainty: float = setting(
        0.99, "1", "No obstacle is more certain than this, so that what is gone is soon forgotten.",
        "engineering judgement")
    min_gone_certainty: float = setting(
        0.5, "1", "An obstacle that is less certain is gone.", "engineering judgement")
    min_footprint_change_m: float = setting(
        0.1, "m", "A frame is revised when an obstacle's footprint turns out otherwise by so much.",
        "engineering judgement")

    # Fault handler
    max_fault_s: float = setting(
        30.0, "s", "A fault that lasts longer ends the mission.", "engineering judgement")
    max_broken_motions: int = setting(
        5, "count", "So many motions broken off in a row end the mission.", "engineering judgement", most=8)
    min_retry_wait_s: float = setting(
        0.25, "s", "Pause before the first retry after a fault; each further one is twice as long.",
        "engineering judgement")
    max_retry_wait_s: float = setting(
        2.0, "s", "Longest pause between retries.", "engineering judgement")
