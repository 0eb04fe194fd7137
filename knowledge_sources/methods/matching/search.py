"""Local search over correspondences, in the image or with a pose (§6.1.1 to §6.1.4).

A state, the chosen pairs, has a best fit (in closed form in the image, §6.1.2, or a step of a pose), and a match error,
derived as a likelihood (§6.1.3). The inner loops are compiled, in `matching_kernels`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from knowledge_sources.methods.arrays import Floats, Indices, Mask
from knowledge_sources.methods.matching.matching_kernels import (
    RIGID,
    STEP,
    SpaceArrays,
    TermArrays,
    compute_fits,
    count_cover,
    search_locally,
)

MIN_GAIN = 1e-9  # a move must lower the match error by more than this (rounding)
CHANCE_EXPONENT = 3.0  # how fast clutter along a model line becomes rarer with its length
CHANCE_LENGTH_PX = 10.0  # length from which clutter along a model line is rare
MAX_MOVES_PER_PAIR = 4  # the search stops after this many moves for each possible pair


@dataclass(frozen=True, slots=True)
class Similarity2:
    """A motion of the model onto the data: ``p_data = R(rotation) (p_model - centre) + centre + shift``.

    Attributes:
        rotation_rad: from u towards v.
        shift_px: (u, v).
        centre_px: the centre of the rotation.
    """

    rotation_rad: float
    shift_px: tuple[float, float]
    centre_px: tuple[float, float]

    def apply(self, points_px: Floats) -> Floats:
        """Model points (..., 2) moved to the data."""
        c, s = math.cos(self.rotation_rad), math.sin(self.rotation_rad)
        turned = (np.asarray(points_px, float) - self.centre_px) @ np.array([[c, s], [-s, c]])
        return np.asarray(turned + self.centre_px + self.shift_px)


class Fits(NamedTuple):
    """Best fits of k states: E_fit (k,), and placements (k, 5) (cos, sin, T_u, T_v, s), or steps (k, d) of a pose."""

    errors: Floats
    placements: Floats


class Fitting(NamedTuple):
    """How states are fitted: RIGID or STEP, and the turn [rad] that a rigid fit starts from."""

    kind: int
    turn_rad: float

    def fit(self, forms: Floats) -> Fits:
        """The best fits of k forms (k, d, d)."""
        return Fits(*compute_fits(np.ascontiguousarray(forms), self.kind, np.full(len(forms), self.turn_rad)))


POSE_STEP = Fitting(STEP, 0.0)
"""Forms (k, d + 1, d + 1) are minimised over the first d of (step, 1); ``placements`` are the steps (k, d)."""


def compute_best_fits(forms: Floats, start: Floats) -> Fits:
    """Minimise k quadratic forms (k, 5, 5) over R and T, where s is 1: T by elimination, then R.

    Source: §6.1.2, E_fit = sum_i (l_i / 2) sum over both ends (n_i . (R p_i + T) - s rho_i)^2, each bracket linear
    in (cos, sin, T_u, T_v, s), so that a state is the sum of its pairs' forms.
    A linear term is left besides the square one, and the minimum is a root of a quartic, which Newton's method finds
    from the turn of ``start`` (5,) or (k, 5).
    """
    turns = np.empty(len(forms))
    turns[:] = np.arctan2(start[..., 1], start[..., 0])
    return Fits(*compute_fits(np.ascontiguousarray(forms), RIGID, turns))


@dataclass(frozen=True, slots=True, eq=False)
class Terms:
    """An objective as the search uses it: each part adds to the match error, smaller is better.

    Attributes:
        end_weights: (k,) weight of a squared end distance [1/px^2], one a data line.
        omission_scale, lengths: (m,); omission of model line L is
            ``scale_L * log((1 + length_L) / (1 + length_L (1 - P_L)))``; P_L is the part that no data line covers.
        anchor_weights: of the weak pull to the start: shift [1/px^2], turn [1/rad^2], scale.
    """

    end_weights: Floats
    omission_scale: Floats
    lengths: Floats
    anchor_weights: tuple[float, float, float]

    @property
    def arrays(self) -> TermArrays:
        """Of the omission, as the compiled functions take them."""
        return self.omission_scale, self.lengths

    def compute_omission(self, uncovered: Floats, lines: Indices) -> Floats:
        """Weighted omission (...) of model lines of which the data leave the part ``uncovered`` (...)."""
        size = self.lengths[lines]
        return np.asarray(self.omission_scale[lines] * np.log((1.0 + size) / (1.0 + size * (1.0 - uncovered))))


def build_likelihood_terms(
    model_lengths: Floats, data_count: int, sigma_px: float, start_px: float
) -> Terms:
    """Minus the log likelihood ratio of "the model is here" against "only clutter is here".

    The end of a paired segment lies off its line by N(0, sigma). Clutter lies along a model line, by chance, for a
    length of at least c with probability (1 + c / chance_length)^-exponent: long lines are rare in clutter, but not as
    rare as if each piece were independent, as a distractor (a crack, a poster's edge) is as straight as a contour. So
    the evidence grows with the logarithm of the length covered, and many model lines seen in part outweigh a few seen
    in full.

    Args:
        model_lengths: (m,) [px]. sigma_px: of a data end across its model line. start_px: error of the start.

    Raises:
        ValueError: a number that must be positive is not.
    """
    exponent, length_px = CHANCE_EXPONENT, CHANCE_LENGTH_PX
    if not (sigma_px > 0 and exponent > 0 and length_px > 0):
        raise ValueError(
            f"expected sigma, chance_exponent and chance_length_px > 0, got {sigma_px}, {exponent}, {length_px}"
        )
    half = 0.5 * float(np.max(model_lengths, initial=1.0))
    return Terms(
        end_weights=np.full(data_count, 0.5 / sigma_px**2),
        omission_scale=np.full(len(model_lengths), exponent),
        lengths=model_lengths / length_px,
        anchor_weights=(0.5 / start_px**2, 0.5 * (half / start_px) ** 2, 0.5 * (half / start_px) ** 2),
    )


@dataclass(frozen=True, slots=True, eq=False)
class PairSpace:
    """The restricted space: p possible pairs of a model line and a data line. A state is a mask (p,) of chosen pairs.

    Attributes:
        model, data: (p,) indices. forms: (p, d, d) shares of E_fit.
        masks: (p, c) cells of the model line that the data line covers.
        lines: number of model lines.
        anchor: (d, d) pull to the placement at which the space was formed.
        fitting: how a state is fitted.
    """

    model: Indices
    data: Indices
    forms: Floats
    masks: Mask
    lines: int
    anchor: Floats
    fitting: Fitting

    @property
    def arrays(self) -> SpaceArrays:
        """As the compiled functions take them."""
        return self.forms, self.masks, self.model, self.data, self.anchor


@dataclass(frozen=True, slots=True, eq=False)
class Correspondence:
    """The best correspondence found.

    Attributes:
        pairs: (p, 2) model index, data index, sorted; many data lines may go to one model line.
        e_fit, e_omission: the two terms of the match error, the second with its weight.
        coverage: (m,) share of each model line that data lines cover.
        residuals_px: (p, 2) distances of the paired data ends to their model lines; of a pose, to first order.
    """

    pairs: Indices
    e_fit: float
    e_omission: float
    coverage: Floats
    residuals_px: Floats

    @property
    def e_match(self) -> float:
        """The match error: smaller is better; only comparable under one objective and one model."""
        return self.e_fit + self.e_omission


class SearchResult(NamedTuple):
    """Where a search ended: (p,) chosen pairs, and E_match of each state on the way (moves + 1,)."""

    chosen: Mask
    errors: Floats


def search_pairs(space: PairSpace, terms: Terms, start: Mask) -> SearchResult:
    """Local search by steepest descent: add or delete one pair at a time (k = 1) while the match error falls.

    A data line goes to one model line: adding a pair takes its data line from the pair that had it. A state that no
    single flip improves may also exchange one data line of a model line for another (§6.1.1 names the lack of that
    move as the cause of local minima).
    """
    most = MAX_MOVES_PER_PAIR * len(start)
    return SearchResult(*search_locally(
        space.arrays, terms.arrays, *space.fitting, start, most, MIN_GAIN))


def evaluate_state(space: PairSpace, terms: Terms, chosen: Mask) -> float:
    """E_match of one state."""
    omission = terms.compute_omission(1.0 - compute_coverage(space, chosen), np.arange(space.lines))
    return float(fit_state(space, chosen).errors[0] + omission.sum())


def fit_state(space: PairSpace, chosen: Mask) -> Fits:
    """The best fit of one state."""
    return space.fitting.fit((space.anchor + space.forms[chosen].sum(axis=0))[None])


def compute_coverage(space: PairSpace, chosen: Mask) -> Floats:
    """(m,) share of each model line that the chosen data lines cover."""
    return np.asarray((count_cover(space.masks, space.model, chosen, space.lines) > 0).mean(axis=1))


def build_masks(along: Floats, lengths: Floats, cells: int) -> Mask:
    """(p, cells) which cells of a model line, ``lengths`` (p,) [px], its data line, ``along`` (p, 2) [px], covers."""
    middles = (np.arange(cells) + 0.5) / cells * lengths[:, None]
    return np.asarray((middles >= along.min(axis=1)[:, None]) & (middles <= along.max(axis=1)[:, None]))


def choose_nearest(data: Indices, distances: Floats, near: Mask) -> Mask:
    """(p,) a state to start from: for each data line the nearest (p,) ``distances`` of its ``near`` pairs."""
    order = np.lexsort((distances, data))
    order = order[near[order]]
    first = np.ones(len(order), bool)
    first[1:] = data[order[1:]] != data[order[:-1]]
    chosen = np.zeros(len(data), bool)
    chosen[order[first]] = True
    return chosen


def list_pairs(space: PairSpace, chosen: Mask) -> tuple[Indices, Indices]:
    """The chosen pairs, sorted: rows (n,) of the space, and (n, 2) model and data indices."""
    rows = np.flatnonzero(chosen)
    rows = rows[np.lexsort((space.data[rows], space.model[rows]))]
    return rows, np.stack([space.model[rows], space.data[rows]], axis=1)
