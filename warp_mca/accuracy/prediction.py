"""Owns predictions from measured scenes for another one: expected errors of each variant, and their uncertainty.

Errors of one figure of one variant are a Gaussian process over the features x of a scene (Rasmussen and Williams,
Gaussian Processes for Machine Learning, 2.2 and 5.4.2): with the mean m of all scenes and their variance s^2,

    k(x, y) = s^2 exp(-|x - y|^2 / (2 l^2)),  K = k(X, X) + diag(n^2),
    e(x) = m + k(x, X) K^-1 (e - m),   var(x) = s^2 - k(x, X) K^-1 k(X, x) + n^2

with the length l that predicts each measured scene best from the others. The noise n of a scene is the uncertainty of
the limits to which its errors refer; for another scene it is the median.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warp_mca.accuracy.figures import BOUND
from warp_mca.accuracy.store import Family, Process
from warp_mca.base.arrays import Array

NOISE = 2e-3  # least noise of the limits [-]
INTERVAL = 5e-3  # the same of durations, which are known to the output interval [-]
DEVIATION = 0.4  # standard deviation of a limit over what may be left of it at most [-]
LENGTHS = (0.5, 1.0, 2.0, 4.0, 8.0)  # in standard deviations of the features, times the root of their number
FAR = 6.0  # standard deviations from the median beyond which an error is an outlier
NEAR = 0.02  # largest distance from the median of a run that is no outlier [-]
NORMAL = 1.4826  # standard deviation of a normal distribution over the median distance from its mean
CORES = (0.5, 1.2)  # least and greatest `Process.core` [-]
MANY = 20  # scenes from which a median tells it
FEWEST = 4  # scenes from which anything is foreseen
LOW, HIGH = 0.5, 3.0  # estimates over true errors between which they are right [-]
SMALL = 0.2  # share of what was asked below which errors need not be distinguished [-]
SIZES = tuple(1e-4 * 1.04**k for k in range(220))  # estimates that are considered [-], up to 0.54


@dataclass(frozen=True)
class Expected:
    """An error that is expected.

    Attributes:
        mean: signed [-].
        spread: standard deviation [-].
        core: as in `Process` [-].
    """

    mean: float
    spread: float
    core: float = 1.0

    @property
    def size(self) -> float:
        """Root of the expected square [-]."""
        return math.hypot(self.mean, self.spread)

    def within(self, share: float) -> float:
        """Probability that the error is no larger than a share [-]."""
        return _normal((share - self.mean) / self.spread) - _normal((-share - self.mean) / self.spread)

    def estimate(self, small: float) -> float:
        """The estimate that is most probably LOW to HIGH times the true size, or below `small` together with it [-]."""
        most = replace(self, spread=self.core * self.spread)

        def right(size: float) -> float:
            if size < small:
                return most.within(max(size / LOW, small))
            return most.within(size / LOW) - most.within(size / HIGH)

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
    """Whether a measured scene is nearer to this one than scenes usually are to their mean; else nothing is known.

    The usual distance is the root of the number of features, in standard deviations of these.
    """
    points = family.points
    if len(points) < FEWEST:
        return False
    apart = (points - np.array(family.coordinates(parameters))) / family.scale
    return bool(((apart**2).sum(axis=1) <= points.shape[1]).any())


def processes_of(family: Family) -> dict[str, list[Process | None]]:
    """`Family.processes` of the scenes that a family has, to be kept with them."""
    return {name: [_process(family, number, name) for number in range(len(family.variants))] for name in BOUND}


def _process(family: Family, variant: int, figure: str) -> Process | None:
    found = _measured(family, variant, figure)
    return None if found is None else fitted(*found)


def _expected(family: Family, parameters: Mapping[str, object], variant: int, figure: str) -> Expected | None:
    found = _measured(family, variant, figure)
    if found is None:
        return None
    points, errors, noise = found
    process = family.processes[figure][variant] if figure in family.processes else None
    here = np.array(family.coordinates(parameters)) / family.scale
    return gaussian_process(points, errors, here, noise, process or fitted(points, errors, noise))


def _measured(family: Family, variant: int, figure: str) -> tuple[Array, Array, Array] | None:
    """Scaled features of the scenes that have a figure of a variant, its errors and their noise; None if too few do."""
    errors = family.errors[figure][:, variant]
    known = np.isfinite(errors)
    if np.count_nonzero(known) < FEWEST:
        return None
    least = INTERVAL if figure == "contact_duration" else NOISE
    noise = np.maximum(least, DEVIATION * family.left[figure][known])
    return family.points[known] / family.scale, errors[known], noise


def gaussian_process(points: Array, errors: Array, here: Array, noise: Array, process: Process) -> Expected:
    """What values at scaled points tell of another point.

    Args:
        points: features of the measured scenes [-], shape (count, feature_count).
        errors: measured there [-], shape (count,).
        here: features of the scene in question [-], shape (feature_count,).
        noise: standard deviations of the errors [-], shape (count,).
        process: as `fitted` to these.
    """
    about, middle, variance = _about(errors, noise)
    K = _covariance(_squares(points), variance, process.length, noise)
    k = variance * np.exp(-((points - here) ** 2).sum(axis=1) / (2.0 * process.length**2))
    weights = np.linalg.solve(K, k)
    left = max(variance - float(k @ weights), 0.0) + _median(noise) ** 2
    return Expected(middle + float(weights @ about), math.sqrt(left), process.core)


def fitted(points: Array, errors: Array, noise: Array) -> Process:
    """The length that predicts each scene best from the others, and the spread of most of these predictions.

    Left out, scene i is off by (K^-1 e)_i / (K^-1)_ii, with the variance 1 / (K^-1)_ii (Rasmussen and Williams, 5.12).
    Arguments are those of `gaussian_process`.
    """
    about, _, variance = _about(errors, noise)
    squares = _squares(points)
    lengths = [scale * math.sqrt(points.shape[1]) for scale in LENGTHS]
    inverses = {length: _inverse(_covariance(squares, variance, length, noise)) for length in lengths}
    length = max(lengths, key=lambda item: _likelihood(inverses[item], about))
    if len(about) < MANY:
        return Process(length, 1.0)
    off = np.abs(inverses[length] @ about) / np.sqrt(np.diag(inverses[length]))
    return Process(length, float(np.clip(NORMAL * _median(off), *CORES)))


def _about(errors: Array, noise: Array) -> tuple[Array, float, float]:
    """Errors about their mean, outliers moved inwards, the mean, and the variance that is taken for them."""
    errors = _without_outliers(errors)
    middle = float(np.mean(errors))
    about = errors - middle
    return about, middle, float(np.mean(about**2) + np.min(noise) ** 2)


def _squares(points: Array) -> Array:
    """Squared distances of points from each other [-], shape (count, count)."""
    own = (points**2).sum(axis=1)
    found = own[:, None] + own
    found -= 2.0 * points @ points.T
    return np.maximum(found, 0.0, out=found)


def _without_outliers(errors: Array) -> Array:
    """Errors with outliers (another peak was taken for the first, say) moved to the edge of the others."""
    middle = _median(errors)
    reach = max(FAR * NORMAL * _median(np.abs(errors - middle)), NEAR)
    return np.clip(errors, middle - reach, middle + reach)


def _covariance(squares: Array, variance: float, length: float, noise: Array) -> Array:
    found = squares / (-2.0 * length**2)
    np.exp(found, out=found)
    found *= variance
    found.flat[:: len(noise) + 1] += noise**2
    return found


def _median(values: Array) -> float:
    """As `np.median`, which takes ten times as long for a hundred values."""
    ordered, half = np.sort(values), len(values) // 2
    return float(0.5 * (ordered[half] + ordered[-half - 1]))


def _inverse(matrix: Array) -> Array:
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def _likelihood(inverse: Array, about: Array) -> float:
    """Logarithm of the probability of each value, given all others, summed up (Rasmussen and Williams, 5.10)."""
    own = 1.0 / np.diag(inverse)
    return float(-0.5 * (np.log(own) + (inverse @ about) ** 2 * own).sum())
