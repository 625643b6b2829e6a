"""Owns closed forms of vibrating beams, and how frequencies are read off histories."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def fitted_frequencies(time: Array, value: Array, guesses: tuple[float, ...]) -> Array:
    """Frequencies [Hz] of the sum of sinusoids and a constant that fits a curve best, shape (len(guesses),), float64.

    Args:
        time: [s], shape (count,).
        value: the curve, shape (count,).
        guesses: near the frequencies [Hz]: within what the curve's duration can tell apart.
    """
    from scipy.optimize import least_squares

    def left_over(share: Array) -> Array:
        phase = 2.0 * np.pi * time[:, None] * (share * guesses)
        basis = np.column_stack([np.cos(phase), np.sin(phase), np.ones(len(time))])
        return value - basis @ np.linalg.lstsq(basis, value, rcond=None)[0]

    found = least_squares(left_over, np.ones(len(guesses)), xtol=1e-12, ftol=1e-14, gtol=1e-14)
    return found.x * guesses


def timoshenko_frequencies(
    *, length: float, depth: float, E: float, G: float, rho: float, shear: float, count: int
) -> tuple[float, ...]:
    """The lowest bending frequencies of a cantilever of rectangular section [Hz], by Timoshenko's theory.

    With w' = psi + V / (kappa G A), psi' = M / (E I), M' = -V - omega^2 rho I psi, V' = -omega^2 rho A w, the
    frequencies are those at which w = psi = 0 at the root allows M = V = 0 at the end.

    Args:
        length, depth: of the beam and its section [m].
        E, G: moduli [Pa].
        rho: density [kg/m^3].
        shear: shear coefficient kappa [-].
        count: how many.
    """
    from scipy.linalg import expm
    from scipy.optimize import brentq

    inertia = depth**2 / 12.0  # I / A; the area cancels
    pace = np.sqrt(E * inertia / rho) / length**2

    def free_end(x: float) -> float:  # of x = omega / pace, in units of length, pace and E I
        w2 = x**2
        slender = inertia / length**2
        A = np.array(
            [
                [0.0, 1.0, 0.0, E * slender / (shear * G)],
                [0.0, 0.0, 1.0, 0.0],
                [0.0, -w2 * slender, 0.0, -1.0],
                [-w2, 0.0, 0.0, 0.0],
            ]
        )
        return float(np.linalg.det(expm(A)[2:, 2:]))

    grid = np.linspace(0.5, 8.0 * count**2 + 2.0, 400 * count)
    values = np.array([free_end(x) for x in grid])
    at = np.flatnonzero(values[:-1] * values[1:] < 0.0)[:count]
    return tuple(float(brentq(free_end, grid[k], grid[k + 1], xtol=1e-13)) * pace / (2.0 * np.pi) for k in at)  # pyright: ignore
