"""Owns the deliberate errors in elements at large strain, of one integration point, and in tetrahedra."""

from __future__ import annotations

from benchmarks.deliberate.mutation import Mutation

ELEMENT_MUTATIONS: dict[str, Mutation] = {
    "finite_pressure_unscaled": Mutation(
        "the pressure of finite strain is K ln J in place of K ln J / J",
        "kernels/materials/kinematics.py",
        "return K * theta * log_over(theta) / (R(1.0) + theta)",
        "return K * theta * log_over(theta)",
    ),
    "finite_shear_unscaled": Mutation(
        "shear off the axes of a large strain is not scaled by the divided difference of the logarithm",
        "kernels/materials/kinematics.py",
        "xy = T[0, 1] * log_over((d[0] - d[1]) / (one + d[1])) / (one + d[1])",
        "xy = T[0, 1] / (one + d[0])",
    ),
    "vectors_without_pressure": Mutation(
        "internal vectors of hex8i do not release the traction of the pressure",
        "kernels/elements/hex8i_small.py",
        "return -share * y - solve(",
        "return -solve(",
        element="hex8i",
    ),
    "vectors_without_flow": Mutation(
        "internal vectors of hex8i do not release what plastic strain relieves",
        "kernels/elements/hex8i_small.py",
        "six = R(6.0)",
        "six = R(0.0)",
        element="hex8i",
    ),
    "hourglass_feels_strain": Mutation(
        "hourglass amplitudes of hex8r keep the part that uniform strain has in distorted elements",
        "kernels/elements/patterns.py",
        "left = add_product(u[3 + m], H, -x[3 + m])",
        "left = u[3 + m]",
        element="hex8r",
    ),
    "hex8r_shear_low": Mutation(
        "the deviatoric stress of hex8r is 1.99 G e in place of 2 G e",
        "kernels/elements/hex8r.py",
        "update(strain, theta, G,",
        "update(R(0.995) * strain, theta, G,",
        element="hex8r",
    ),
    "tet4_shear_low": Mutation(
        "the deviatoric stress of tet4 is 1.99 G e in place of 2 G e",
        "kernels/elements/tet4.py",
        "update(strain, R(0.0),",
        "update(R(0.995) * strain, R(0.0),",
        element="tet4",
    ),
    "tet4_forces_not_turned_back": Mutation(
        "forces of tetrahedra stay in the element's own frame",
        "kernels/elements/tet4.py",
        "add_matrices(P, W, P)",
        "P",
        element="tet4",
    ),
    "rate_halved": Mutation(
        "Cowper and Symonds' law takes half the rate of the plastic strain",
        "kernels/materials/cowper_symonds.py",
        "power(dp / (dt * c.law",
        "power(R(0.5) * dp / (dt * c.law",
        element="tet4",
    ),
    "back_stress_never_fades": Mutation(
        "the first back stress of Chaboche's law grows without its recall",
        "kernels/materials/chaboche.py",
        "Y1 = one * (X1",
        "Y1 = (X1",
        element="tet4",
    ),
    "relaxation_halved": Mutation(
        "what relaxes of a Prony series in a step is half of it",
        "kernels/materials/prony.py",
        "dz = gone * left",
        "dz = R(0.5) * gone * left",
        element="hex8",
    ),
    "second_invariant_low": Mutation(
        "the second modulus of Mooney and Rivlin's law is too low",
        "kernels/materials/mooney_rivlin.py",
        "pair(law[m, 3], law[m, 4])",
        "pair(law[m, 3], R(0.9) * law[m, 4])",
        element="tet4",
    ),
    "foam_crushed_half": Mutation(
        "the curve of foam is read at half of its crushing",
        "kernels/materials/crushable_foam.py",
        "curve(crushed, c)",
        "curve(R(0.5) * crushed, c)",
        element="hex8",
    ),
}
