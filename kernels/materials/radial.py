"""Owns the radial return of isotropic laws: q - 3 G dp = h(p + dp) r(dp / dt), by Newton's method.

A law gives its hardening h as a function (p, c) -> (flow stress at rest, slope over p) [Pa] of the equivalent plastic
strain p, and the factor r of its rate as a function (dp, dt, c) -> (factor [-], slope over dp [-]) of the growth dp > 0
in the time dt [s]; it is 1 at rest and does not fall.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import scalars

wp.set_module_options({"enable_backward": False})

ITERATIONS = 3  # of hardening alone; with rates 4 to 7, where the first two find hardening and its slope anew

# Plastic strain, its equivalent p, what p lacks [-], plastic work [J/m^3]; of the last step that flowed the flow stress
# [Pa] and the growth of p [-].
HISTORY = ("deviator", "scalar", "scalar", "scalar", "scalar", "scalar")
SIZE, WORK = 10, 7  # rows of the history; row of the plastic work


@cache
def increment_function(precision: str, kind: Any, hardening: Any, rate: Any = None, iterations: int = 0) -> Any:
    """The function (q, G, p, dt, guess, c) -> dp, with parameters c of this `kind`; 0 where q is below yield.

    The root lies below (q - h(p)) / (3 G). Newton's method starts from the guess, or from half of that where it is 0.
    It goes up as usual, and down in ln dp, in which the logarithm of a rate is linear: dp stays above 0. There are no
    branches, so that a CPU computes several elements at once.
    """
    R, anew = scalars(precision).real, ITERATIONS if rate is None else 2

    @wp.func
    def increment(q: R, G: R, p: R, dt: R, guess: R, c: kind):
        stiffness = R(3.0) * G
        hard, slope = hardening(p, c)
        most = (q - hard) / stiffness
        flows = most > R(0.0)
        most = wp.where(flows, most, R(1e-6))  # any, where the result is not taken
        x = wp.where(guess > R(0.0), wp.min(guess, most), R(0.5) * most)
        at = x
        for k in range(wp.static(iterations or ITERATIONS)):
            if wp.static(k < anew):
                hard, slope = hardening(p + x, c)
                at = x
            sigma = hard + slope * (x - at)
            tangent = slope
            if wp.static(rate is not None):
                factor, growth = rate(x, dt, c)
                tangent = slope * factor + sigma * growth
                sigma = sigma * factor
            over = (stiffness * x + sigma - q) / ((stiffness + tangent) * x)
            down = R(1.0) / (R(1.0) + over + R(0.5) * over * over)  # e^-over to second order
            x = wp.min(most, wp.where(over > R(0.0), x * down, x - over * x))
        return wp.where(flows, x, R(0.0))

    return increment


@cache
def isotropic_return(precision: str, kind: Any, hardening: Any) -> Any:
    """The `return_map` of a law of flow without rates, see `kernels.materials.laws`."""
    t = scalars(precision)
    R, mat33 = t.real, t.mat33
    increment = increment_function(precision, kind, hardening)

    @wp.func
    def radial_return(elastic: mat33, eps_p: mat33, p: R, G: R, c: kind):
        trial = elastic - R(2.0) * G * eps_p
        q = wp.sqrt(R(1.5) * wp.ddot(trial, trial))
        p_new = p + increment(q, G, p, R(0.0), R(0.0), c)
        dp = p_new - p  # what p takes of it: the next step corrects the rest, and rounding does not add up
        eps_p = eps_p + wp.where(dp > R(0.0), R(1.5) * dp / q, R(0.0)) * trial
        return elastic - R(2.0) * G * eps_p, eps_p, p_new

    return radial_return


@cache
def rated_return(precision: str, kind: Any, hardening: Any, rate: Any, iterations: int = 7, heated: Any = None) -> Any:
    """The `flow` of a law with rates or heat, whose history is `HISTORY`, see `kernels.materials.laws`.

    `heated` is the function (c, work) -> c that changes the parameters with the plastic work before the step.

    The growth dp of slow flow is below the rounding of p. p and the plastic strain then take it once it has added up:
    a correction by the next step would have the rate of many steps at once.
    """
    t = scalars(precision)
    R, mat33, rows = t.real, t.mat33, wp.types.vector(SIZE, t.real)
    increment = increment_function(precision, kind, hardening, rate, iterations)

    @wp.func
    def rated_flow(elastic: mat33, h: rows, dt: R, G: R, c: kind):
        trial = elastic - R(2.0) * G * mat33(h[0], h[2], h[4], h[2], h[1], h[3], h[4], h[3], -h[0] - h[1])
        size = wp.sqrt(R(1.5) * wp.ddot(trial, trial))
        q = size - R(3.0) * G * h[6]
        if wp.static(heated is not None):
            c = heated(c, h[7])
        dp = increment(q, G, h[5], dt, h[9], c)
        S = trial
        new = h
        if dp > R(0.0):
            q = q - R(3.0) * G * dp
            before = wp.where(h[8] > R(0.0), h[8], q)
            grown = h[6] + dp
            p = h[5] + grown
            taken = p - h[5]
            flow = (R(1.5) * taken / size) * trial
            S = (q / size) * trial
            work = h[7] + R(0.5) * (before + q) * dp
            new = rows(
                h[0] + flow[0, 0],
                h[1] + flow[1, 1],
                h[2] + flow[0, 1],
                h[3] + flow[1, 2],
                h[4] + flow[0, 2],
                p,
                grown - taken,
                work,
                q,
                dp,
            )
        return S, new, dp

    return rated_flow


@cache
def kept_work(precision: str, kind: Any) -> Any:
    """The `plastic_work` of a law whose history is `HISTORY`, see `kernels.materials.laws`."""
    R = scalars(precision).real
    rows = wp.types.vector(SIZE, R)

    @wp.func
    def plastic_work(h: rows, c: kind):
        return h[wp.static(WORK)]

    return plastic_work
