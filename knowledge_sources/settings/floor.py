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
    sight_m: float = setting(
        4.5, "m", "The floor is looked at up to this distance from the camera.", "engineering judgement")
    max_untold_m: float = setting(
        0.15, "m", "Depth of floor beside the model's own parts that is taken to be free, though its looks tell nothing"
        " there.", "engineering judgement")
    max_hidden_m: float = setting(
        0.2, "m", "Floor counts as seen where nothing higher than this can hide below the picture's lower border.",
        "engineering judgement")
    bearings: int = setting(64, "count", "Directions in which the free floor of a picture is written down.",
                            "engineering judgement")
    max_rolled_over_m: float = setting(
        0.05, "m", "What is not higher than this is rolled over.", "engineering judgement")

    # Appearance
    min_floor_pixels: int = setting(
        150, "count", "With fewer pixels of a floor in sight, its looks are not learnt from a picture.",
        "engineering judgement")
    max_chroma_error: float = setting(
        0.035, "1", "Largest difference from the model's colour, in its parts of red and blue, of what may be floor.",
        "engineering judgement")
    min_chroma_sigma: float = setting(
        0.005, "1", "Floor of the standard deviation of the floor's colour.", "engineering judgement")
    min_brightness_sigma: float = setting(
        0.05, "1", "Floor of the standard deviation of the logarithm of the floor's brightness.",
        "engineering judgement")
    max_unlike: float = setting(
        5.0, "1", "Pixels further than so many standard deviations from the floor's looks do not look like it.",
        "engineering judgement")
    max_shade_step: float = setting(
        2.5, "1", "From floor in light to floor in shade, neighbouring pixels differ by at most so many standard "
        "deviations of the floor's looks.", "engineering judgement")
    max_shade_chroma: float = setting(
        0.06, "1", "Largest difference of the parts of red and blue between floor in light and in shade.",
        "engineering judgement")
    min_floor_share: float = setting(
        0.3, "1", "Share of what should be floor that must agree with its known looks; else the picture may be tinted.",
        "engineering judgement")
    min_tinted_share: float = setting(
        0.6, "1", "Share of what should be floor that must look alike, to be the floor in a tinted picture.",
        "engineering judgement")
    max_tint: float = setting(
        0.12, "1", "Largest difference from the floor's colour, in its parts of red and blue, in a tinted picture.",
        "engineering judgement")
    max_light_age_s: float = setting(
        20.0, "s", "The light of a picture tells that of the next ones for so long.", "engineering judgement")
    max_samples: float = setting(
        2000.0, "count", "Past pixels of a floor weigh at most as much as this many.", "engineering judgement")

    # Things
    model_margin_px: float = setting(
        3.0, "px", "Pixels so near to an edge of the model tell nothing; the belief's uncertainty comes on top.",
        "engineering judgement")
    min_thing_pixels: int = setting(
        10, "count", "Smallest region, in pixels of half the picture's size.", "engineering judgement")
    assumed_depth_m: float = setting(
        0.3, "m", "Depth that a thing is taken to have behind what is seen of it.", "engineering judgement")
    max_thing_depth_m: float = setting(
        0.8, "m", "Feet of one thing are at most so much further than its nearest.", "engineering judgement")
    p_seen_once: float = setting(
        0.7, "1", "Probability that what does not look like the floor stands on it, before parallax tells.",
        "engineering judgement")

    # Parallax
    min_parallax_px: float = setting(
        3.0, "px", "Parallax tells where solid and flat things differ by at least this.", "engineering judgement")
    parallax_odds: float = setting(
        50.0, "1", "Odds that one clear comparison of two pictures is worth.", "engineering judgement")
    min_parallax_correlation: float = setting(
        0.5, "1", "Smallest correlation of two patches that tells anything.", "engineering judgement")
    min_parallax_margin: float = setting(
        0.15, "1", "Smallest difference of the correlations of the two hypotheses that tells anything.",
        "engineering judgement")

    foot_part_step: float = setting(
        0.05, "1", "Distances at which a lower border may hang over the floor are tried in steps of this part.",
        "engineering judgement")
    min_foot_part: float = setting(
        0.4, "1", "Least part of its seeming distance at which a lower border is looked for.", "engineering judgement")
    min_foot_margin: float = setting(
        0.07, "1", "Smallest difference of the mean correlations of a lower border over the floor and on it that tells "
        "anything.", "engineering judgement")
    min_foot_columns: int = setting(
        6, "count", "With fewer patches of a lower border its height is not told.", "engineering judgement")

    # Ranges
    max_belief_sigma_m: float = setting(
        0.15, "m", "A less certain place tells of no free floor.", "engineering judgement")
    max_range_age_s: float = setting(
        5.0, "s", "A reading is compared with those that are no older.", "engineering judgement")
    range_sigmas: float = setting(
        3.0, "1", "Free floor ends so many standard deviations of a distance before an echo.", "engineering judgement")
    range_slack_m: float = setting(
        0.1, "m", "An echo that is nearer than the model's nearest wall or thing by no more is of that: what is flush "
        "with a wall is not in the model.", "engineering judgement")
    max_range_thing_m: float = setting(
        1.2, "m", "A thing is concluded from an echo up to here from its sensor: further, its cone is too wide.",
        "engineering judgement")
    range_bearings: int = setting(
        120, "count", "Directions in which the free floor of a reading is written down.", "engineering judgement")
    range_arc_points: int = setting(
        9, "count", "Places on the arc of an echo that are asked after.", "engineering judgement")
    max_earlier_readings: int = setting(
        4, "count", "Readings that the newest is compared with.", "engineering judgement")
    range_join_m: float = setting(
        0.2, "m", "Echoes of neighbouring sensors that are no further apart are of one thing.", "engineering judgement")
    range_depth_m: float = setting(
        0.1, "m", "How deep a thing is taken to be that was ranged.", "engineering judgement")
    echo_p: float = setting(
        0.7, "1", "Probability of a thing after one echo that the model does not explain.", "engineering judgement")
    max_range_p: float = setting(
        0.99, "1", "Probability that many echoes come to.", "engineering judgement")
