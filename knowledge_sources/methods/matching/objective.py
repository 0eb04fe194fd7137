"""How good a correspondence is: the paper's match error and one derived as a likelihood (§6.1.3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Objective = Literal["paper", "likelihood"]


@dataclass(frozen=True, slots=True, eq=False)
class Terms:
    """What the search needs to know of an objective, each a smaller-is-better share of the match error.

    Attributes:
        end_weights: (k,) weight of a squared end distance [1/px^2], one a data line.
        omission_scale, lengths: (m,), and omission_rate: omission of model line L is ``scale_L * e^(rate P_L)``,
            or, if the rate is 0, ``scale_L * log((1 + length_L) / (1 + length_L (1 - P_L)))``.
        anchor_weights: of the weak pull to the start: shift [1/px^2], turn [1/rad^2], scale.
    """

    end_weights: Array
    omission_scale: Array
    lengths: Array
    omission_rate: float
    anchor_weights: tuple[float, float, float]

    @property
    def arrays(self) -> tuple[Array, Array, float]:
        """Of the omission, as the compiled loops take them."""
        return self.omission_scale, self.lengths, self.omission_rate

    def omission(self, uncovered: Array, lines: NDArray[np.intp]) -> Array:
        """Weighted omission (...) of model lines whose share ``uncovered`` (...) the data do not account for."""
        if self.omission_rate == 0.0:
            size = self.lengths[lines]
            return np.asarray(self.omission_scale[lines] * np.log((1.0 + size) / (1.0 + size * (1.0 - uncovered))))
        return np.asarray(self.omission_scale[lines] * np.exp(self.omission_rate * uncovered))


def paper_terms(model_lengths: Array, data_lengths: Array, alpha: float, beta: float) -> Terms:
    """E_match = E_fit + alpha sum_L e^(beta P_L). Source: §6.1.3.

    Lengths count relative to the model's: E_fit is a mean squared distance [px^2], and a model line's omission
    weighs by its share of the model ("perhaps on the basis of model line length"); so weighted it spans Figure 12(d).
    """
    total = max(float(np.sum(model_lengths)), 1.0)
    return Terms(
        end_weights=0.5 * data_lengths / total,
        omission_scale=alpha * model_lengths / total,
        lengths=model_lengths,
        omission_rate=beta,
        anchor_weights=(1e-6, 1e-2, 1e-2),
    )


def likelihood_terms(
    model_lengths: Array, data_count: int, sigma_px: float, chance_exponent: float, chance_px: float, start_px: float
) -> Terms:
    """Minus the log likelihood ratio of "the model is here" against "nothing but clutter is".

    A paired end lies off its line by N(0, sigma). Clutter lies along a model line, by chance, for a length of at
    least c with probability (1 + c / chance_px)^-exponent: long lines are rare in clutter, but not as rare as if each
    piece came by itself, for a distractor (a crack, a poster's edge) is as straight as a contour. So evidence grows
    with the logarithm of the length accounted for, and many model lines seen in part outweigh a few seen in full.
    The start is right to about ``start_px``.
    """
    if not (sigma_px > 0 and chance_exponent > 0 and chance_px > 0):
        raise ValueError(
            f"expected sigma_px, chance_exponent and chance_px > 0, got {sigma_px}, {chance_exponent}, {chance_px}"
        )
    half = 0.5 * float(np.max(model_lengths, initial=1.0))
    return Terms(
        end_weights=np.full(data_count, 0.5 / sigma_px**2),
        omission_scale=np.full(len(model_lengths), chance_exponent),
        lengths=model_lengths / chance_px,
        omission_rate=0.0,
        anchor_weights=(0.5 / start_px**2, 0.5 * (half / start_px) ** 2, 0.5 * (half / start_px) ** 2),
    )
