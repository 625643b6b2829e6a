"""Owns cyclic hardening: two back stresses beside isotropic hardening that saturates.

Each back stress X follows Armstrong and Frederick, dX = (2/3) C d eps_p - gamma X dp; the radius of the yield surface
is sigma_y + Q (1 - exp(-b p)): Chaboche, Int. J. Plasticity 5 (1989) 247. Integrated by backward differences,
X' = (X + (2/3) C d eps_p) / (1 + gamma dp), the direction of flow is that of trial - sum X / (1 + gamma dp), and one
equation for dp is left (Kobayashi and Ohno, Int. J. Numer. Meth. Engng 53 (2002) 2217).
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import scalars

wp.set_module_options({"enable_backward": False})

HISTORY = ("deviator", "scalar", "deviator", "deviator", "scalar")  # plastic strain, p, back stresses, plastic work
_BACK, _WORK = 6, 16
_MOST = 24  # iterations; four to eight are usual
_LEFT = {"mixed": 2.0**-22, "float64": 2.0**-48}  # residual over the trial stress at which they end


@cache
def types(precision: str) -> tuple[Any, Any]:
    """Parameters sigma_y, Q [Pa], b [-], C_1 [Pa], gamma_1 [-], C_2 [Pa], gamma_2 [-]; rows of the history."""
    R = scalars(precision).real
    return wp.types.vector(7, R), wp.types.vector(17, R)


@cache
def parameters(precision: str) -> Any:
    """The function (law, m, scale) -> parameters of row m of `Model.law`, from column 2 on; a scale of 1."""
    R, (row, _) = scalars(precision).real, types(precision)

    @wp.func
    def chaboche_parameters(law: wp.array2d(dtype=R), m: int, scale: R):
        c = row()
        for i in range(7):
            c[i] = law[m, 2 + i]
        return c

    return chaboche_parameters


@cache
def increment_function(precision: str) -> Any:
    """The function (trial, X_1, X_2, p, G, c) -> (dp, direction trial - sum X / (1 + gamma dp), its size).

    size(dp) - 3 G dp - sum C dp / (1 + gamma dp) = radius(p + dp), by Newton's method in a bracket.
    """
    t = scalars(precision)
    R, mat33, (row, _) = t.real, t.mat33, types(precision)

    @wp.func
    def increment(trial: mat33, X1: mat33, X2: mat33, p: R, G: R, c: row):
        n = trial - X1 - X2
        size = wp.sqrt(R(1.5) * wp.ddot(n, n))
        full = size
        low = R(0.0)
        high = (size - c[0] - c[1] * (R(1.0) - wp.exp(-c[2] * p))) / (R(3.0) * G)
        x = wp.max(high, R(0.0))
        if x > R(0.0):
            for _ in range(wp.static(_MOST)):
                one = R(1.0) / (R(1.0) + c[4] * x)
                two = R(1.0) / (R(1.0) + c[6] * x)
                n = trial - one * X1 - two * X2
                size = wp.sqrt(R(1.5) * wp.ddot(n, n))
                left = c[1] * wp.exp(-c[2] * (p + x))
                residual = (R(3.0) * G + one * c[3] + two * c[5]) * x + c[0] + c[1] - left - size
                if wp.abs(residual) <= R(wp.static(_LEFT[precision])) * full:
                    break
                if residual > R(0.0):
                    high = x
                else:
                    low = x
                turn = one * one * c[4] * wp.ddot(n, X1) + two * two * c[6] * wp.ddot(n, X2)
                slope = R(3.0) * G + one * one * c[3] + two * two * c[5] + c[2] * left - R(1.5) * turn / size
                x = x - residual / slope
                if not (x >= low and x <= high):
                    x = R(0.5) * (low + high)
        return x, n, size

    return increment


@cache
def flow(precision: str) -> Any:
    """The function (elastic, history, dt, G, c) -> (S, history, dp); rates have no effect."""
    t = scalars(precision)
    R, mat33, (row, rows), increment = t.real, t.mat33, types(precision), increment_function(precision)

    @wp.func
    def tensor(h: rows, i: int):
        return mat33(h[i], h[i + 2], h[i + 4], h[i + 2], h[i + 1], h[i + 3], h[i + 4], h[i + 3], -h[i] - h[i + 1])

    @wp.func
    def with_tensor(h: rows, i: int, T: mat33):
        h[i] = T[0, 0]
        h[i + 1] = T[1, 1]
        h[i + 2] = T[0, 1]
        h[i + 3] = T[1, 2]
        h[i + 4] = T[0, 2]
        return h

    @wp.func
    def chaboche_flow(elastic: mat33, h: rows, dt: R, G: R, c: row):
        eps_p = tensor(h, 0)
        X1 = tensor(h, wp.static(_BACK))
        X2 = tensor(h, wp.static(_BACK + 5))
        S = elastic - R(2.0) * G * eps_p
        dp, n, size = increment(S, X1, X2, h[5], G, c)
        new = h
        if dp > R(0.0):
            p = h[5] + dp
            dp = p - h[5]  # what p takes of it: the next step corrects the rest, and rounding does not add up
            grown = (R(1.5) * dp / size) * n
            one = R(1.0) / (R(1.0) + c[4] * dp)
            two = R(1.0) / (R(1.0) + c[6] * dp)
            Y1 = one * (X1 + (R(2.0) / R(3.0) * c[3]) * grown)
            Y2 = two * (X2 + (R(2.0) / R(3.0) * c[5]) * grown)
            S = S - R(2.0) * G * grown
            # at the start of the step the stress on the yield surface was the radius along n, and the back stresses
            before = (c[0] + c[1] * (R(1.0) - wp.exp(-c[2] * h[5]))) * dp + wp.ddot(X1 + X2, grown)
            new = with_tensor(new, 0, eps_p + grown)
            new[5] = p
            new = with_tensor(new, wp.static(_BACK), Y1)
            new = with_tensor(new, wp.static(_BACK + 5), Y2)
            new[wp.static(_WORK)] = h[wp.static(_WORK)] + R(0.5) * (before + wp.ddot(S, grown))
        return S, new, dp

    return chaboche_flow


@cache
def plastic_work(precision: str) -> Any:
    """The function (history, c) -> plastic work per volume [J/m^3], stored in back stresses or dissipated."""
    row, rows = types(precision)

    @wp.func
    def chaboche_work(h: rows, c: row):
        return h[wp.static(_WORK)]

    return chaboche_work
