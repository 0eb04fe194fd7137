"""Settings of seeing whether a door is open or shut."""

from __future__ import annotations

from dataclasses import dataclass

from knowledge_sources.settings.setting import setting

_JUDGED = "engineering judgement"


@dataclass(frozen=True, slots=True)
class DoorSettings:
    """The numbers by which a doorway's state is seen."""

    # Which doorways are looked at
    max_distance_m: float = setting(7.0, "m", "Largest distance of a doorway that is looked at.", _JUDGED)
    min_away_m: float = setting(0.5, "m", "Least distance of the camera from the plane of the opening.", _JUDGED)
    min_sine: float = setting(0.35, "1", "Least sine of the angle at which the opening is seen.", _JUDGED)
    min_width_px: float = setting(20.0, "px", "Least width of an opening in the picture.", _JUDGED)
    min_height_px: float = setting(40.0, "px", "Least height of an opening in the picture.", _JUDGED)
    border_px: float = setting(6.0, "px", "Distance that samples keep from the border of the picture.", _JUDGED)
    frame_m: float = setting(0.3, "m", "How much of what is round an opening is compared too.", _JUDGED)
    samples_per_side: int = setting(28, "count", "Samples along each side of an opening.", _JUDGED)
    edge_margin_px: float = setting(3.0, "px", "Distance that samples keep from the edges of faces.", _JUDGED)
    jamb_margin_m: float = setting(0.05, "m", "Distance that samples keep from jambs, head and floor.", _JUDGED)
    margin_sigmas: float = setting(
        2.0, "1", "Standard deviations of the pose that are added to that distance.", _JUDGED)
    min_samples: int = setting(40, "count", "Fewest samples by which an opening is judged.", _JUDGED)

    # What a leaf looks like
    min_grey: float = setting(6.0, "grey levels", "Least median brightness of an opening that is judged.", _JUDGED)
    max_grey: float = setting(
        250.0, "grey levels", "A sample is overexposed where one of its colors is brighter.", _JUDGED)
    min_exposed_share: float = setting(
        0.8, "1", "Least share of an opening's samples that are not overexposed, where it is judged.", _JUDGED)
    dark_offset: float = setting(
        4.0, "1", "Grey levels added before a ratio of colors is taken, against noise in the dark.", _JUDGED)
    min_compared: int = setting(
        20, "count", "Fewest samples for which the model has a color.", _JUDGED)
    max_leaf_brightness: float = setting(
        0.2, "1", "Largest difference of log brightness within a leaf.", _JUDGED)
    max_leaf_tint: float = setting(
        0.08, "1", "Largest difference of log color, without brightness, within a leaf.", _JUDGED)
    max_gain_brightness: float = setting(
        0.15, "1", "Largest difference of log brightness from the model's, up to one gain.", _JUDGED)
    max_gain_tint: float = setting(
        0.06, "1", "Largest difference of log color, without brightness, from the model's, up to one gain.", _JUDGED)
    foot_m: float = setting(0.35, "m", "Height of what counts as the foot of an opening.", _JUDGED)
    min_foot_samples: int = setting(8, "count", "Fewest samples at the foot, and above it, by which both compare.",
                                    _JUDGED)
    min_frame_samples: int = setting(
        12, "count", "Fewest samples round an opening by which it is told whether something stands before it.", _JUDGED)
    min_frame_share: float = setting(
        0.6, "1", "Least share of them that has the model's color, up to one gain, where nothing stands before it.",
        _JUDGED)
    max_frame_leaf_share: float = setting(
        0.4, "1", "Largest share of them that has the color of the opening, where that is a leaf.", _JUDGED)

    # When a door is believed to be shut
    max_log_ratio: float = setting(
        4.5, "1", "Most that one picture may add to the log odds of a door: 90 to 1.", _JUDGED)
    min_log_ratio: float = setting(2.0, "1", "Least that is counted.", _JUDGED)
    prior_log_odds: float = setting(
        4.0, "1", "Log odds that a door is as it is believed to be, before a picture is taken: 98 %.", _JUDGED)
    shut_log_odds: float = setting(
        4.6, "1", "Log odds from which a door is shut: 99 %.", _JUDGED)
    open_log_odds: float = setting(
        -3.0, "1", "Log odds up to which a door is open: 95 %.", _JUDGED)
    max_log_odds: float = setting(7.0, "1", "Largest log odds that are kept, that a door may open again.", _JUDGED)
    min_pictures: int = setting(2, "count", "Fewest pictures by which a door is shut.", _JUDGED)
    min_step_m: float = setting(0.3, "m", "Pictures of a door that count both are taken so far from each other ...",
                                _JUDGED)
    min_turn_rad: float = setting(0.17, "rad", "Or turned by so much.", _JUDGED)
    max_sigma_m: float = setting(
        0.1, "m", "Largest standard deviation of the robot's place when it judges a door.", _JUDGED)
    max_sigma_rad: float = setting(
        0.035, "rad", "Largest standard deviation of its heading when it does.", _JUDGED)

    # When a milestone was refuted
    max_doubted_sigma_m: float = setting(
        0.3, "m", "Largest standard deviation of the place at which a shut door may explain a picture.", _JUDGED)
    max_doubted_sigma_rad: float = setting(
        0.07, "rad", "Largest standard deviation of the believed heading at which it may.", _JUDGED)
    max_doubted_sigmas: float = setting(
        3.0, "1", "Standard deviations of the belief within which the explained pose must be.", _JUDGED)
    min_explained_better: float = setting(
        10.0, "1", "Least ratio by which the pose is likelier to be wrong with the door open.", _JUDGED)
    refuted_log_ratio: float = setting(
        4.6, "1", "What a milestone that is refuted at a trusted place adds for a door that explains it.",
        _JUDGED)
    min_few_lines: int = setting(
        3, "count", "Fewest lines by which a frame is told, where they are too few to tell the place by.", _JUDGED)
    min_few_share: float = setting(0.6, "1", "Least share of these that must be there.", _JUDGED)
    min_sure_frame_share: float = setting(
        0.8, "1", "Where there are fewer, least share of the opening's frame that has the model's color.", _JUDGED)
