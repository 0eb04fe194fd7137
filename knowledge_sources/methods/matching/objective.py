"""How good a correspondence is: the paper's match error, and one derived as a likelihood (§6.1.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from knowledge_sources.methods.arrays import Floats, Indices
from knowledge_sources.methods.matching.kernels import TermArrays
from knowledge_sources.settings.matching import MatchingSettings


@dataclass(frozen=True, slots=True, eq=False)
class Terms:
    """An objective as the search uses it: each part adds to the match error, smaller is better.

    Attributes:
        end_weights: (k,) weight of a squared end distance [1/px^2], one a data line.
        omission_scale, lengths: (m,), and omission_rate: omission of model line L is ``scale_L * e^(rate P_L)``,
            or, if the rate is 0, ``scale_L * log((1 + length_L) / (1 + length_L (1 - P_L)))``; P_L is the part of the
            line that no data line covers.
        anchor_weights: of the weak pull to the start: shift [1/px^2], turn [1/rad^2], scale.
    """

    end_weights: Floats
    omission_scale: Floats
    lengths: Floats
    omission_rate: float
    anchor_weights: tuple[float, float, float]

    @property
    def arrays(self) -> TermArrays:
        """Of the omission, as the compiled functions take them."""
        return self.omission_scale, self.lengths, self.omission_rate

    def compute_omission(self, uncovered: Floats, lines: Indices) -> Floats:
        """Weighted omission (...) of model lines of which the data leave the part ``uncovered`` (...)."""
        if self.omission_rate == 0.0:
            size = self.lengths[lines]
            return np.asarray(self.omission_scale[lines] * np.log((1.0 + size) / (1.0 + size * (1.0 - uncovered))))
        return np.asarray(self.omission_scale[lines] * np.exp(self.omission_rate * uncovered))


def build_paper_terms(model_lengths: Floats, data_lengths: Floats, settings: MatchingSettings) -> Terms:
    """E_match = E_fit + alpha sum_L e^(beta P_L). Source: §6.1.3.

    Lengths (m,), (k,) [px] count relative to the model's: E_fit is a mean squared distance [px^2], and a model line's
    omission weighs by its share of the model ("perhaps on the basis of model line length"). So weighted, the error
    spans the range of Figure 12(d).
    """
    total = max(float(np.sum(model_lengths)), 1.0)
    return Terms(
        end_weights=0.5 * data_lengths / total,
        omission_scale=settings.omission_alpha * model_lengths / total,
        lengths=model_lengths,
        omission_rate=settings.omission_beta,
        anchor_weights=(1e-6, 1e-2, 1e-2),
    )


def build_likelihood_terms(
    model_lengths: Floats, data_count: int, sigma_px: float, start_px: float, settings: MatchingSettings
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
    exponent, length_px = settings.chance_exponent, settings.chance_length_px
    if not (sigma_px > 0 and exponent > 0 and length_px > 0):
        raise ValueError(
            f"expected sigma, chance_exponent and chance_length_px > 0, got {sigma_px}, {exponent}, {length_px}"
        )
    half = 0.5 * float(np.max(model_lengths, initial=1.0))
    return Terms(
        end_weights=np.full(data_count, 0.5 / sigma_px**2),
        omission_scale=np.full(len(model_lengths), exponent),
        lengths=model_lengths / length_px,
        omission_rate=0.0,
        anchor_weights=(0.5 / start_px**2, 0.5 * (half / start_px) ** 2, 0.5 * (half / start_px) ** 2),
    )
