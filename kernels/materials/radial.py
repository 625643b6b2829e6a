"""Owns the radial return of isotropic laws: q - 3 G dp = sigma(p + dp, dp / dt), by Newton's method in a bracket.

A law gives its flow stress as a function (p, dp, dt, c) -> (sigma, slope over dp) [Pa], with the equivalent plastic
strain p after the growth dp in the time dt [s].
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import scalars

wp.set_module_options({"enable_backward": False})

ITERATIONS = 7  # two or three are usual where the rate is that of the step before

# Plastic strain, its equivalent p, what p lacks [-], plastic work [J/m^3]; of the last step that flowed the flow stress
# [Pa] and the growth of p [-].
HISTORY = ("deviator", "scalar", "scalar", "scalar", "scalar", "scalar")
SIZE, WORK = 10, 7  # rows of the history; row of the plastic work


@cache
def increment_function(precision: str, strength: Any, kind: Any) -> Any:
    """The function (q, G, p, dt, guess, c) -> dp, with parameters c of this `kind`; 0 where q is below yield.

    The flow stress does not fall as dp grows, so that the root lies between 0 and (q - sigma(p, 0)) / (3 G). Newton's
    method starts from the guess, or from above where that is 0. Where the flow stress is concave it is below the root
    after a step, and then comes from below. A step out of the bracket goes to a sixteenth of it. There are no branches,
    so that a CPU computes several elements at once.
    """
    R = scalars(precision).real

    @wp.func
    def increment(q: R, G: R, p: R, dt: R, guess: R, c: kind):
        stiffness = R(3.0) * G
        sigma, slope = strength(p, R(0.0), dt, c)
        high = (q - sigma) / stiffness
        flows = high > R(0.0)
        high = wp.where(flows, high, R(1e-6))  # any, where the result is not taken
        low = R(0.0)
        x = wp.where(guess > R(0.0), wp.min(high, guess), high)
        for _ in range(wp.static(ITERATIONS)):
            sigma, slope = strength(p + x, x, dt, c)
            residual = stiffness * x + sigma - q
            above = residual > R(0.0)
            high = wp.where(above, x, high)
            low = wp.where(above, low, x)
            step = x - residual / (stiffness + slope)
            inside = step >= low and step <= high
            x = wp.where(inside, step, low + R(0.0625) * (high - low))
        return wp.where(flows, x, R(0.0))

    return increment


@cache
def isotropic_return(precision: str, strength: Any, kind: Any) -> Any:
    """The `return_map` of a law of flow without rates, see `kernels.materials.laws`."""
    t = scalars(precision)
    R, mat33 = t.real, t.mat33
    increment = increment_function(precision, strength, kind)

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
def rated_return(precision: str, strength: Any, kind: Any, heated: Any = None) -> Any:
    """The `flow` of a law with rates or heat, whose history is `HISTORY`, see `kernels.materials.laws`.

    `heated` is the function (c, work) -> c that changes the parameters with the plastic work before the step.

    The growth dp of slow flow is below the rounding of p. p and the plastic strain then take it once it has added up:
    a correction by the next step would have the rate of many steps at once.
    """
    t = scalars(precision)
    R, mat33, rows = t.real, t.mat33, wp.types.vector(SIZE, t.real)
    increment = increment_function(precision, strength, kind)

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
