"""Owns what measured scenes tell of another one: expected errors of each variant there, and how uncertain they are.

Errors of one figure of one variant are a Gaussian process over the features x of a scene (Rasmussen and Williams,
Gaussian Processes for Machine Learning, 2.2 and 5.4.2): with the mean m of all scenes and their variance s^2,

    k(x, y) = s^2 exp(-|x - y|^2 / (2 l^2)),  K = k(X, X) + diag(n^2),
    e(x) = m + k(x, X) K^-1 (e - m),   var(x) = s^2 - k(x, X) K^-1 k(X, x) + n^2

with the length l under which each measured scene would have been foreseen best from the others. The noise n is that of
the limits from which errors are counted, in each scene as far as these are known; for another scene it is the median.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_mca.accuracy.store import Family

Array = NDArray[np.float64]

NOISE = 2e-3  # least noise of the limits [-]
INTERVAL = 5e-3  # the same of durations, which are known to the output interval [-]
DEVIATION = 0.4  # standard deviation of a limit over what may be left of it at most [-]
LENGTHS = (0.5, 1.0, 2.0, 4.0, 8.0)  # in standard deviations of the features, times the root of their number
FAR = 6.0  # standard deviations from the median beyond which an error is an outlier
NEAR = 0.02  # distance from the median within which it is none [-]
FEWEST = 4  # scenes from which anything is foreseen
LOW, HIGH = 0.5, 3.0  # estimates over true errors between which they are right [-]
SMALL = 0.2  # of what was asked: errors below it need not be told apart [-]
SIZES = tuple(1e-4 * 1.04**k for k in range(220))  # estimates that are considered [-], up to 0.54


@dataclass(frozen=True)
class Expected:
    """An error that is expected.

    Attributes:
        mean: signed [-].
        spread: standard deviation [-].
    """

    mean: float
    spread: float

    @property
    def size(self) -> float:
        """Root of the expected square [-]."""
        return math.hypot(self.mean, self.spread)

    def within(self, share: float) -> float:
        """Probability that the error is no larger than a share [-]."""
        return _normal((share - self.mean) / self.spread) - _normal((-share - self.mean) / self.spread)

    def estimate(self, small: float) -> float:
        """The size that is most probably right [-]: LOW to HIGH times the true one, or both of them below `small`."""

        def right(size: float) -> float:
            if size < small:
                return self.within(max(size / LOW, small))
            return self.within(size / LOW) - self.within(size / HIGH)

        return max(SIZES, key=lambda size: (right(size), -abs(math.log(size / self.size))))


def _normal(x: float) -> float:
    """Probability that a value of the standard normal distribution is below x."""
    return 0.5 * math.erfc(-x / math.sqrt(2.0))


def expected_errors(
    family: Family, parameters: Mapping[str, object], variant: int, figures: Sequence[str]
) -> dict[str, Expected | None]:
    """Error of each figure of a variant in a scene of the family; None where too few scenes tell."""
    return {name: _expected(family, parameters, variant, name) for name in figures}


def is_close(family: Family, parameters: Mapping[str, object]) -> bool:
    """Whether some measured scene is nearer to this one than scenes lie from their mean; else nothing is known of it.

    Scenes lie from it the root of the number of features, in standard deviations of these.
    """
    points = family.points
    if len(points) < FEWEST:
        return False
    apart = (points - np.array(family.coordinates(parameters))) / _scale(points)
    return bool(((apart**2).sum(axis=1) <= points.shape[1]).any())


def _scale(points: Array) -> Array:
    """Standard deviations of features."""
    return np.maximum(points.std(axis=0), 1e-12 + 1e-3 * np.abs(points).max(axis=0))


def _expected(family: Family, parameters: Mapping[str, object], variant: int, figure: str) -> Expected | None:
    errors = [(scene.errors.get(variant) or {}).get(figure) for scene in family.scenes]
    known = [k for k, error in enumerate(errors) if error is not None]
    if len(known) < FEWEST:
        return None
    points, here = family.points[known], np.array(family.coordinates(parameters))
    scale = _scale(points)
    least = INTERVAL if figure == "contact_duration" else NOISE
    left = [family.scenes[k].left.get(figure) or 0.0 for k in known]
    noise = np.maximum(least, DEVIATION * np.array(left))
    return gaussian_process(points / scale, np.array([errors[k] for k in known]), here / scale, noise)


def gaussian_process(points: Array, errors: Array, here: Array, noise: Array) -> Expected:
    """What values at scaled points tell of another point.

    Args:
        points: features of the measured scenes [-], shape (count, feature_count).
        errors: measured there [-], shape (count,).
        here: features of the scene in question [-], shape (feature_count,).
        noise: standard deviations of the errors [-], shape (count,).
    """
    errors = _without_outliers(errors)
    middle = float(np.mean(errors))
    about = errors - middle
    variance = float(np.mean(about**2) + np.min(noise) ** 2)
    squares = ((points[:, None] - points[None]) ** 2).sum(axis=2)
    lengths = [scale * math.sqrt(points.shape[1]) for scale in LENGTHS]
    length = max(lengths, key=lambda item: _likelihood(_covariance(squares, variance, item, noise), about))
    K = _covariance(squares, variance, length, noise)
    k = variance * np.exp(-((points - here) ** 2).sum(axis=1) / (2.0 * length**2))
    weights = np.linalg.solve(K, k)
    left = max(variance - float(k @ weights), 0.0) + float(np.median(noise)) ** 2
    return Expected(middle + float(weights @ about), math.sqrt(left))


def _without_outliers(errors: Array) -> Array:
    """Errors; those far off, where another peak was taken for the first, say, are moved to the edge of the others."""
    middle = float(np.median(errors))
    reach = max(FAR * 1.4826 * float(np.median(np.abs(errors - middle))), NEAR)  # 1.4826: of a normal distribution
    return np.clip(errors, middle - reach, middle + reach)


def _covariance(squares: Array, variance: float, length: float, noise: Array) -> Array:
    return variance * np.exp(-squares / (2.0 * length**2)) + np.diag(noise**2)


def _likelihood(covariance: Array, about: Array) -> float:
    """Logarithm of the probability of each value, given all others, summed up (Rasmussen and Williams, 5.10)."""
    inverse = np.linalg.inv(covariance)
    own = 1.0 / np.diag(inverse)
    return float(-0.5 * (np.log(own) + (inverse @ about) ** 2 * own).sum())
