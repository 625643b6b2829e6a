"""Owns the deliberate errors in the failure of elements."""

from __future__ import annotations

from benchmarks.deliberate.mutation import Mutation

FAILURE_MUTATIONS: dict[str, Mutation] = {
    "failure_late": Mutation(
        "elements fail at a damage of 1.05",
        "kernels/elements/failure.py",
        "worst >= wp.float64(1.0)",
        "worst >= wp.float64(1.05)",
        element="hex8i",
    ),
    "damage_without_rate": Mutation(
        "Johnson and Cook's strain at failure does not rise with the rate",
        "kernels/failure/johnson_cook.py",
        "R(1.0) + c[3] * wp.log(",
        "R(1.0) + R(0.0) * wp.log(",
        element="hex8i",
    ),
    "length_upside_down": Mutation(
        "strains at failure fall in smaller cells",
        "warp_mca/scene/failure.py",
        "(self.reference_length / length)",
        "(length / self.reference_length)",
        element="hex8i",
    ),
}
