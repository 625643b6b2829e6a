"""Owns the deliberate errors in the damping of bodies and in springs."""

from __future__ import annotations

from benchmarks.deliberate.mutation import Mutation

DAMPING_MUTATIONS: dict[str, Mutation] = {
    "branches_halved": Mutation(
        "Maxwell branches give half of their forces",
        "kernels/nodes/damping.py",
        "F += bodies.gain[begin + k] * y",
        "F += wp.float64(0.5) * bodies.gain[begin + k] * y",
    ),
    "damping_counted_half": Mutation(
        "half of the energy that damping takes is booked",
        "kernels/nodes/damping.py",
        "wp.float64(0.5) * dt * wp.dot(damping_out[e] + F, v_i)",
        "wp.float64(0.25) * dt * wp.dot(damping_out[e] + F, v_i)",
    ),
    "stiffness_part_halved": Mutation(
        "the stiffness part of damping is halved",
        "kernels/nodes/damping.py",
        "F = bodies.lag[b] * change",
        "F = wp.float64(0.5) * bodies.lag[b] * change",
    ),
    "mass_part_halved": Mutation(
        "the mass part of damping is halved",
        "kernels/nodes/damping.py",
        "return -bodies.mass_rate[b] * nodes.mass[i] * (v - own)",
        "return wp.float64(-0.5) * bodies.mass_rate[b] * nodes.mass[i] * (v - own)",
    ),
    "dashpot_lags": Mutation(
        "dashpots of springs read the speed of half a step before",
        "kernels/nodes/spring.py",
        "half = wp.float64(0.5) * dt * damp[1]",
        "half = wp.float64(0.0) * dt * damp[1]",
    ),
    "springs_stiff": Mutation(
        "springs are stiffer by a hundredth",
        "kernels/nodes/spring.py",
        "spring = preload[j] + stiff[0]",
        "spring = preload[j] + wp.float64(1.01) * stiff[0]",
    ),
}
