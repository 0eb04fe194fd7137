"""Global localization: where is the robot, if it may be anywhere in these rooms?

Candidates are refined, weighed against each other, and compared with the places that look alike (aliases).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache
from itertools import islice

import shapely

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.localization.aliasing import find_repetitions
from knowledge_sources.methods.localization.next_view import (
    PoseHypothesis,
    SensingAction,
    are_distinguishable,
    can_distinguish,
    choose_sensing_action,
    find_widest_gap,
    make_safety_check,
    make_view_predictor,
    normalize_log_likelihoods,
)
from knowledge_sources.methods.localization.none_of_these import MIN_P_PLACE, compute_p_place
from knowledge_sources.methods.localization.pose_candidates import (
    FINE_CLIMB_M,
    FINE_CLIMB_RAD,
    PictureSearch,
    are_distinct,
)
from knowledge_sources.methods.localization.refinement import (
    ALIKE_LOG_NOISE,
    PoseLikelihood,
    refine_to_likelier,
)
from knowledge_sources.methods.localization.views import CameraView, align_headings
from knowledge_sources.methods.verification import predict_lines
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

MIN_VIEWS = 2
"""Fewest views by which a pose is accepted: one may fit a place that the model lacks (checked with harvey experiment
kidnap)."""
MAX_SEARCHED_VIEWS = 4  # views after which places are followed, and no longer searched for, while two are accepted
MIN_LOG_LIKELIHOOD = 2.0  # smallest log likelihood of a hypothesis that is kept (checked with harvey experiment kidnap)
REFUTING_LOG_RATIO = 8.0
"""Log likelihood ratio (Bayes factor) by which a better hypothesis refutes a distinct one (checked with harvey
experiment kidnap)."""
MAX_HYPOTHESES = 6  # most hypotheses that are kept
MIN_P_TRACKED = 0.8  # smallest probability, against all places that look alike, of a place that is not doubted
MAX_VIEWS_OF_SEARCH = 8  # most views, the last, by which the floor is searched; what is found is refined by all
MAX_CANDIDATES = 14  # most candidates of a floor that are refined
MIN_CANDIDATES = 4  # and fewest, however many views each is refined by
MAX_REFINED_VIEWS = MAX_CANDIDATES * MAX_VIEWS_OF_SEARCH
"""Bound of a search's work: so many views of candidates are refined, and again as many of what looks like the best."""
BUMP_REACH_M = 2.0  # so far from where it was believed a robot may be that nobody kidnapped
MIN_ALIAS_SCORE = 0.6  # another place shows at least this part of what agrees at the one that is kept

AliasTest = Callable[[Pose2, Pose2], bool]
"""Whether two poses would look the same in all views."""


@dataclass(frozen=True, slots=True, eq=False)
class PlaceCandidate:
    """A place where the robot may be now.

    Attributes:
        room, world_from_robot, covariance: where; (3, 3) over (x, y, heading), world.
        likelihood: how well the views support it.
        is_accepted: whether it may be believed where it stands alone, by its odds against none of these.
        weight: its probability, against all that are kept and none of these.
    """

    room: str
    world_from_robot: Pose2
    covariance: Floats
    likelihood: PoseLikelihood
    is_accepted: bool
    weight: float = 1.0

    @property
    def hypothesis(self) -> PoseHypothesis:
        """Room, pose and weight."""
        return PoseHypothesis(self.room, self.world_from_robot, self.weight)


class LocalizationStatus(Enum):
    """What the views say of where the robot is."""

    FOUND = "found"
    PROBE = "probe"
    AMBIGUOUS = "ambiguous"


@dataclass(frozen=True, slots=True, eq=False)
class LocalizationResult:
    """The outcome of one localization.

    Attributes:
        status: found (one accepted candidate is left), probe (another look is needed), or ambiguous (no look within
            reach would tell the best two candidates apart).
        candidates: those that are kept, the likeliest first.
        next_action: what to look at next; None where nothing new can be seen.
    """

    status: LocalizationStatus
    candidates: tuple[PlaceCandidate, ...]
    next_action: SensingAction | None = None


def localize(
    robot: RobotModel, views: Sequence[CameraView], rooms: Sequence[str],
    guess: tuple[str, Pose2] | None = None, followed: Sequence[tuple[str, Pose2]] = (),
    touched: Sequence[Floats] = (), p_guess: float = 0.0, *, is_searched: bool = True,
) -> LocalizationResult:
    """Find the robot in these rooms by its views, the last of which was taken from where it is now.

    Args:
        guess: a room and a pose that are always tried: of many places that look alike only some are.
        p_guess: how likely it was there, before these views.
        followed: the candidates of the last localization, moved as the robot moved since: they are tried too.
        touched: where something was touched, (2,) [m] in the robot's frame now: no move leads there.
        is_searched: whether the floor is; else only the places that are followed are weighed, with their aliases.
    """
    aligned = align_headings(views, robot.camera, robot.mount.camera_from_robot)
    candidates = find_candidates(robot, aligned, rooms, guess, followed, p_guess, is_searched=is_searched)
    return decide(robot, candidates, [view.now_from_then for view in aligned], touched)


def find_candidates(
    robot: RobotModel, views: Sequence[CameraView], rooms: Sequence[str],
    guess: tuple[str, Pose2] | None = None, followed: Sequence[tuple[str, Pose2]] = (), p_guess: float = 0.0,
    *, is_searched: bool = True,
) -> tuple[PlaceCandidate, ...]:
    """Find the places in these rooms that explain all views (with aligned headings), the likeliest first.

    In the order of belief: a place to which ``guess`` leads is tried first, and kept if it is not refuted; then what is
    near it. The rest of the floor is searched where that leaves it open (:func:`choose_rooms`). After many views places
    are followed and not searched for, while two of them are accepted. If one accepted place is left, its aliases on the
    whole floor are weighed too.
    """
    are_aliases = make_alias_test(robot, [view.now_from_then for view in views])
    found = _build_distinct(robot, views, [] if guess is None else [guess])
    known: list[PlaceCandidate] = []
    if len(views) > MAX_SEARCHED_VIEWS:
        known = _build_distinct(robot, views, followed, found)
    if sum(bool(c.is_accepted) for c in (*found, *known)) >= 2:
        return rank_candidates([*found, *known], are_aliases, len(views), found[0] if found else None)
    pictures = PictureSearch.from_views(robot, views[-MAX_VIEWS_OF_SEARCH:])
    searched = [*found]
    likely = choose_rooms(robot, rooms, guess, found, p_guess, len(views)) if is_searched else []
    for candidate in _find_refined(robot, views, likely, pictures):
        _keep_likelier(searched, candidate)
    first = None
    if found:  # the place of the guess, though the search may have found more exactly where it is
        first = min(searched, key=lambda c: c.world_from_robot.distance_to(found[0].world_from_robot))
    for candidate in known or _build_distinct(robot, views, followed):
        _keep_likelier(searched, candidate)
    kept = rank_candidates(searched, are_aliases, len(views), first)
    if len(kept) != 1 or not kept[0].is_accepted:
        return kept
    aliases = find_aliases(robot, views, kept[0].world_from_robot, rooms, likely)
    beside = [_build_candidate(robot, views, c.room, c.world_from_robot) for c in aliases]
    repeated = _sift(pictures, kept[0].room, kept[0].world_from_robot, _list_repetitions(robot, kept[0], rooms),
                     count_refined(len(views)))
    beside += _build_distinct(robot, views, repeated, [*kept, *beside])
    rivals = [_polish(robot, views, c) for c in (*kept, *beside)]
    return rank_candidates(rivals, are_aliases, len(views), rivals[0])


def choose_rooms(
    robot: RobotModel, rooms: Sequence[str], guess: tuple[str, Pose2] | None, found: Sequence[PlaceCandidate],
    p_guess: float, looks: int,
) -> list[str]:
    """Choose the rooms in which places are searched for, in the order in which they are given: the nearest first.

    Where the robot was believed to be, and is accepted to be by what it sees, it is nowhere else but where everything
    looks the same, which the plan tells without a search; so only what is within a bump's reach is searched. With too
    few looks for any place to be accepted the rest waits too. Otherwise all rooms are searched.

    Args:
        found: the places to which the guess leads.
        p_guess: how likely the robot was there, before these looks.
    """
    if guess is None or p_guess < MIN_P_TRACKED:
        return list(rooms)
    if looks >= MIN_VIEWS and not any(c.is_accepted for c in found):
        return list(rooms)
    here = shapely.Point(guess[1].position)
    return [room for room in rooms if shapely.Polygon(robot.world.outline(room)).distance(here) <= BUMP_REACH_M]


def count_refined(looks: int) -> int:
    """How many places a search refines by so many looks: the more looks, the fewer."""
    return max(MIN_CANDIDATES, min(MAX_CANDIDATES, MAX_REFINED_VIEWS // max(looks, 1)))


def _sift(
    pictures: PictureSearch | None, room: str, pose: Pose2, places: Iterable[tuple[str, Pose2]], most: int,
) -> list[tuple[str, Pose2]]:
    """Of the places where the plan repeats itself those that show about as much of the pictures as a pose in a room.

    The best of them, in the order in which they were given.
    """
    if pictures is None:
        return [*islice(places, most)]
    least = MIN_ALIAS_SCORE * pictures.rate(room, pose)
    rated = [(rate, k, place) for k, place in enumerate(places) if (rate := pictures.rate(*place)) >= least]
    best = sorted(rated, key=lambda one: (-one[0], one[1]))[:most]
    return [place for _, _, place in sorted(best, key=lambda one: one[1])]


def _build_distinct(
    robot: RobotModel, views: Sequence[CameraView], rough: Iterable[tuple[str, Pose2]],
    known: Sequence[PlaceCandidate] = (),
) -> list[PlaceCandidate]:
    """Candidates from rough poses in rooms, refined, that are none of those that are known, each once."""
    found: list[PlaceCandidate] = []
    for room, pose in rough:
        candidate = _build_candidate(robot, views, room, pose)
        if all(are_distinct(candidate.world_from_robot, c.world_from_robot) for c in (*known, *found)):
            found.append(candidate)
    return found


def _keep_likelier(found: list[PlaceCandidate], new: PlaceCandidate) -> None:
    """Add a candidate; of those that are one place the likeliest is kept, as refining may end near the right pose."""
    near = [c for c in found if not are_distinct(new.world_from_robot, c.world_from_robot)]
    if all(new.likelihood.log_likelihood > c.likelihood.log_likelihood for c in near):
        found[:] = [*(c for c in found if c not in near), new]


def _polish(
    robot: RobotModel, views: Sequence[CameraView], rough: PlaceCandidate
) -> PlaceCandidate:
    """The candidate refined once more, from where it ended: what decides between two is not from where each began."""
    again = _build_candidate(robot, views, rough.room, rough.world_from_robot)
    return max((rough, again), key=lambda c: c.likelihood.log_likelihood)


def _list_repetitions(
    robot: RobotModel, candidate: PlaceCandidate, rooms: Sequence[str]
) -> Iterator[tuple[str, Pose2]]:
    """Where the plan repeats the candidate's place; what is in the rooms may differ, which the pictures tell."""
    room = _find_room(robot, rooms[0], candidate.world_from_robot)
    return find_repetitions(robot.world, room, candidate.world_from_robot, rooms)


def find_aliases(
    robot: RobotModel, views: Sequence[CameraView], pose: Pose2, rooms: Sequence[str],
    likely: Sequence[str] | None = None,
) -> tuple[PlaceCandidate, ...]:
    """Find the other places of these rooms that would look the same in all views, by the model alone.

    The pictures are not used: missed, hidden or additional lines may make one of two aliases much less likely than the
    other. The search is for what should be visible from ``pose``. Where few lines are, the grid may be too coarse to
    find an alias, so the places at which the plan repeats itself are tried too. ``likely``: the rooms that are
    searched, all of them by default.
    """
    lines = [predict_lines(robot, view.pose_then(pose)) for view in views]
    predicted = [replace(view, segments_px=seen.segments_px) for view, seen in zip(views, lines, strict=True)]
    are_aliases = make_alias_test(robot, [view.now_from_then for view in views])
    found: list[PlaceCandidate] = []

    def is_alias(other: Pose2) -> bool:
        known = (pose, *(alias.world_from_robot for alias in found))
        return all(are_distinct(other, one) for one in known) and are_aliases(pose, other)

    pictures = PictureSearch.from_views(robot, predicted[-MAX_VIEWS_OF_SEARCH:])
    for refined in _find_refined(robot, predicted, rooms if likely is None else likely, pictures):
        if is_alias(refined.world_from_robot):
            found.append(refined)
    here = _find_room(robot, rooms[0], pose)
    repeated = find_repetitions(robot.world, here, pose, rooms)
    for room, other in _sift(pictures, here, pose, repeated, count_refined(len(views))):
        if is_alias(other):
            found.append(_build_candidate(robot, predicted, room, other))
    return tuple(found)


def make_alias_test(robot: RobotModel, looked: Sequence[Pose2]) -> AliasTest:
    """Return a test whether two poses would look the same in all views, by the model."""
    predict = lru_cache(maxsize=64)(make_view_predictor(robot))

    def are_aliases(one: Pose2, other: Pose2) -> bool:
        views, others = ([predict(pose @ look) for look in looked] for pose in (one, other))
        return not are_distinguishable(views, others)

    return are_aliases


def rank_candidates(
    found: Sequence[PlaceCandidate], are_aliases: AliasTest, looks: int,
    first: PlaceCandidate | None = None,
) -> tuple[PlaceCandidate, ...]:
    """Keep the likely candidates that the likeliest does not refute, with their weights, the likeliest first.

    The likeliest refutes a candidate by the log likelihood ratio (Bayes factor) of all looks, or of a single one in
    which half of the candidate's lines are missing; a candidate by which itself would be refuted in this way is kept.
    One that would look the same by the model, chance may have made much less likely: it is refuted only by a ratio
    beyond the noise of all ``looks``, as if all of it pointed one way. Where too many are left, ``first`` is none that
    is left out.
    """
    noise = ALIKE_LOG_NOISE * looks
    order = sorted((c for c in found if c.likelihood.log_likelihood >= MIN_LOG_LIKELIHOOD),
                   key=lambda c: -c.likelihood.log_likelihood)
    kept = [c for c in order if not _is_refuted(c.likelihood, order[0].likelihood, REFUTING_LOG_RATIO)
            or (c.likelihood.log_likelihood >= order[0].likelihood.log_likelihood - REFUTING_LOG_RATIO - noise
                and are_aliases(order[0].world_from_robot, c.world_from_robot))]
    if first in kept[MAX_HYPOTHESES:]:
        kept[MAX_HYPOTHESES - 1] = first
    kept = kept[:MAX_HYPOTHESES]
    weights = normalize_log_likelihoods([_get_log(c.likelihood, kept[0].likelihood) for c in kept])
    p_any = max((compute_p_place(c.likelihood) for c in kept), default=0.0)
    return tuple(replace(c, weight=p_any * weight) for c, weight in zip(kept, weights, strict=True))


def _get_log(one: PoseLikelihood, best: PoseLikelihood) -> float:
    """The log likelihood by which a candidate is weighed: no less than the likeliest, where a look refutes that one."""
    return best.log_likelihood if best.is_refuted_by_a_look(one, REFUTING_LOG_RATIO) else one.log_likelihood


def _is_refuted(one: PoseLikelihood, best: PoseLikelihood, log_ratio: float) -> bool:
    """Whether the likeliest refutes a candidate: by one look, where that is one-sided, else by all together.

    Where one look refutes each of them, neither pose is right: the sum of all looks does not decide between these.
    """
    by_a_look = one.is_refuted_by_a_look(best, log_ratio)
    if best.is_refuted_by_a_look(one, log_ratio):
        return False
    return by_a_look or one.log_likelihood < best.log_likelihood - log_ratio


def decide(
    robot: RobotModel, candidates: Sequence[PlaceCandidate], looked: Sequence[Pose2],
    touched: Sequence[Floats] = (),
) -> LocalizationResult:
    """Decide whether the robot is found, cannot be found, or needs another look, and which."""
    kept, enough = tuple(candidates), len(looked) >= MIN_VIEWS
    if len(kept) == 1 and kept[0].is_accepted and enough:
        return LocalizationResult(LocalizationStatus.FOUND, kept)
    if not kept:
        return LocalizationResult(LocalizationStatus.PROBE, (), SensingAction(find_widest_gap(looked), 0.0, 0.0))
    predict, is_safe = make_view_predictor(robot), make_safety_check(robot, touched)
    hypotheses = [c.hypothesis for c in kept]
    tied = len(kept) > 1 and all(c.is_accepted for c in kept[:2]) and enough
    if tied and not can_distinguish(hypotheses[0], hypotheses[1], looked, predict, is_safe):
        return LocalizationResult(LocalizationStatus.AMBIGUOUS, kept)
    action = choose_sensing_action(hypotheses, looked, predict, is_safe)
    return LocalizationResult(LocalizationStatus.PROBE, kept, action)


def _find_refined(
    robot: RobotModel, views: Sequence[CameraView], rooms: Sequence[str],
    pictures: PictureSearch | None,
) -> list[PlaceCandidate]:
    """The best candidates by the last views, refined by all; not the same pose twice."""
    found = list[PlaceCandidate]()
    for rough in () if pictures is None else pictures.find(rooms, count_refined(len(views))):
        new = _build_candidate(robot, views, rough.room, rough.world_from_robot)
        pose = new.world_from_robot
        if all(pose.distance_to(other.world_from_robot) > FINE_CLIMB_M
               or abs(wrap_angle(pose.heading_rad - other.world_from_robot.heading_rad)) > FINE_CLIMB_RAD
               for other in found):
            found.append(new)
    return found


def _build_candidate(
    robot: RobotModel, views: Sequence[CameraView], room: str, rough: Pose2
) -> PlaceCandidate:
    """A candidate from a rough pose, found in a room: refined, where that makes it likelier."""
    pose, covariance, likelihood = refine_to_likelier(robot, views, rough)
    is_accepted = compute_p_place(likelihood) >= MIN_P_PLACE
    return PlaceCandidate(_find_room(robot, room, pose), pose, covariance, likelihood, is_accepted)


def _find_room(robot: RobotModel, room: str, pose: Pose2) -> str:
    """The room in which a pose lies; in a doorway the one from which it was found."""
    there = robot.world.locale_at([*pose.position, robot.world.floor_m(room)])
    return there if there is not None and robot.world.is_room(there) else room
