"""Owns deliberate errors: changes of the engine's text that verification cases must notice.

`python -m benchmarks.mutations` makes each in a copy and runs the cases that say they catch it.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Mutation:
    """A deliberate error.

    Attributes:
        what: is wrong then, to end the sentence "fails when …".
        file: that is changed, from the repository's root.
        old: text that stands there once.
        new: what takes its place.
    """

    what: str
    file: str
    old: str
    new: str


MUTATIONS: dict[str, Mutation] = {
    "shear_modulus_doubled": Mutation(
        "the deviatoric stress is 4 G e in place of 2 G e",
        "kernels/j2.py",
        "S = R(2.0) * G * (e - eps_p)",
        "S = R(4.0) * G * (e - eps_p)",
    ),
    "pressure_halved": Mutation(
        "the pressure of an element is halved",
        "kernels/hex8.py",
        "pressure = K * dilation / volume",
        "pressure = R(0.5) * K * dilation / volume",
    ),
    "contact_soft": Mutation(
        "contact springs are ten times too soft",
        "kernels/contact.py",
        "Fn = -k * gap",
        "Fn = -wp.float64(0.1) * k * gap",
    ),
    "gauss_points_moved": Mutation(
        "the Gauss points lie at 0.5 in place of 0.577",
        "kernels/hex8.py",
        "_GAUSS = 0.5773502691896257",
        "_GAUSS = 0.5",
    ),
    "rotation_to_first_order": Mutation(
        "displacements are turned back without their own part",
        "kernels/hex8.py",
        "u[a] + Wt * (X[a] + u[a])",
        "u[a] + Wt * X[a]",
    ),
    "forces_not_turned_back": Mutation(
        "forces stay in the element's own frame",
        "kernels/hex8.py",
        "= f[a] + W * f[a]",
        "= f[a]",
    ),
    "rate_force_reversed": Mutation(
        "centrifugal forces of the rigid chain have the wrong sign",
        "warp_mca/chain.py",
        "(upper.T - upper) @ theta_dot**2",
        "(upper - upper.T) @ theta_dot**2",
    ),
    "hand_off_spins_backwards": Mutation(
        "nodes take the link's angular velocity with the wrong sign at hand-off",
        "warp_mca/handoff.py",
        "np.cross(self.angular_velocity, r)",
        "np.cross(r, self.angular_velocity)",
    ),
    "vibration_energy_doubled": Mutation(
        "hand-back doubles the kinetic energy that does not fit",
        "warp_mca/handback.py",
        "vibration_energy=float(0.5 * left)",
        "vibration_energy=float(left)",
    ),
    "far_links_weightless": Mutation(
        "a link of the rigid chain does not carry the weight of the links beyond it",
        "warp_mca/chain.py",
        "return perpendicular(self._turn(theta, self._moments[0])) @ np.asarray(self.gravity)",
        "return perpendicular(self._turn(theta, self._mass[:, None] * self._centre)) @ np.asarray(self.gravity)",
    ),
    "pressure_varies_within_elements": Mutation(
        "each integration point adds a tenth of its own pressure to the element's one",
        "kernels/hex8.py",
        "S = R(2.0) * G * strain",
        "S = R(2.0) * G * strain + R(0.1) * K * inverse * trace * wp.identity(n=3, dtype=R)",
    ),
    "joint_impulse_halved": Mutation(
        "the impulse of a joint is counted by half",
        "kernels/constraint.py",
        "impulse_out[k] + mass[i] * (v - v_out[i])",
        "impulse_out[k] + wp.float64(0.5) * mass[i] * (v - v_out[i])",
    ),
    "shown_pressure_halved": Mutation(
        "the pressure in the stress that is shown is halved",
        "kernels/output.py",
        "wp.float32(law[m, 0] * dilation / volume)",
        "wp.float32(R(0.5) * law[m, 0] * dilation / volume)",
    ),
    "hinge_forgets_masses": Mutation(
        "two tied nodes take their plain mean motion in place of the mass-weighted one",
        "kernels/constraint.py",
        "return (m_a * a + m_b * b) / (m_a + m_b)",
        "return wp.float64(0.5) * (a + b)",
    ),
}
