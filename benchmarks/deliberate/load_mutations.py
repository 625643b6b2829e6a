"""Owns the deliberate errors in loads on nodes and in thermal strains."""

from __future__ import annotations

from benchmarks.deliberate.mutation import Mutation

LOAD_MUTATIONS: dict[str, Mutation] = {
    "load_of_an_instant": Mutation(
        "a step takes the factor of a load at t(n) in place of its mean over the step",
        "kernels/loads/amplitude.py",
        "return mean_value(tables, load, t - half, t + half)",
        "return value_at(tables, load, t)",
    ),
    "pressure_on_faces_halved": Mutation(
        "faces take half of a pressure",
        "kernels/loads/nodes.py",
        "force = faces.traction[load][2] * vector",
        "force = wp.float64(0.5) * faces.traction[load][2] * vector",
    ),
    "nodal_force_raised": Mutation(
        "forces on nodes are 5 % too large",
        "kernels/loads/nodes.py",
        "total += share[j] * mean_of_step(",
        "total += wp.float64(1.05) * share[j] * mean_of_step(",
    ),
    "thermal_strain_halved": Mutation(
        "elements take half of a thermal strain",
        "kernels/loads/thermal.py",
        "extreme_out[THERMAL, e] = R(stiffness * now)",
        "extreme_out[THERMAL, e] = R(wp.float64(0.5) * stiffness * now)",
    ),
}
