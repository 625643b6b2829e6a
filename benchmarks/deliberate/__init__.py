"""Owns deliberate errors: changes of the engine's text that verification cases must notice.

`python -m benchmarks.mutations` makes each in a copy and runs the cases that say they catch it.
"""

from __future__ import annotations

from benchmarks.deliberate.catches import CATCHES
from benchmarks.deliberate.damping_mutations import DAMPING_MUTATIONS
from benchmarks.deliberate.element_mutations import ELEMENT_MUTATIONS
from benchmarks.deliberate.failure_mutations import FAILURE_MUTATIONS
from benchmarks.deliberate.load_mutations import LOAD_MUTATIONS
from benchmarks.deliberate.mutation import Mutation
from benchmarks.deliberate.rigid_mutations import RIGID_MUTATIONS
from benchmarks.deliberate.robot_mutations import ROBOT_MUTATIONS

MUTATIONS: dict[str, Mutation] = {
    "shear_modulus_doubled": Mutation(
        "the return map takes 4 G e for the deviatoric stress in place of 2 G e",
        "kernels/materials/j2.py",
        "xi = elastic - (R(2.0) * G",
        "xi = R(2.0) * elastic - (R(4.0) * G",
    ),
    "pressure_halved": Mutation(
        "the pressure of an element is halved",
        "kernels/elements/hex8_small.py",
        "Fz = to_lines(Sz + pressure * Bz)\n        return edge_to_node(Fx, Fy, Fz, W)",
        "half = R(0.5) * pressure\n"
        "        Fx = to_lines(Sx + half * Bx)\n"
        "        Fy = to_lines(Sy + half * By)\n"
        "        Fz = to_lines(Sz + half * Bz)\n"
        "        return edge_to_node(Fx, Fy, Fz, W)",
    ),
    "tie_forces_lost": Mutation(
        "masters of ties take half of the forces on their slaves",
        "kernels/nodes/tied.py",
        "total += tied.share[e] * f",
        "total += wp.float64(0.5) * tied.share[e] * f",
    ),
    "contact_soft": Mutation(
        "contact springs are ten times too soft",
        "kernels/contact/penalty.py",
        "return k * depth",
        "return wp.float64(0.1) * k * depth",
    ),
    "reaction_halved": Mutation(
        "what touches gives back half the force that it takes",
        "kernels/contact/contact.py",
        "total -= w[c] * force",
        "total -= wp.float64(0.5) * w[c] * force",
    ),
    "friction_limit_doubled": Mutation(
        "friction may reach 2 mu F_n",
        "kernels/contact/spring.py",
        "limit = mu * Fn",
        "limit = wp.float64(2.0) * mu * Fn",
    ),
    "friction_limit_halved": Mutation(
        "friction may reach only mu F_n / 2",
        "kernels/contact/spring.py",
        "limit = mu * Fn",
        "limit = wp.float64(0.5) * mu * Fn",
    ),
    "friction_does_not_decay": Mutation(
        "laws of friction see a block at rest",
        "kernels/contact/friction_laws.py",
        "speed = wp.length(du - wp.dot(du, normal) * normal) / dt",
        "speed = wp.float64(0.0)",
    ),
    "friction_decays_too_fast": Mutation(
        "laws of friction see ten times the speed",
        "kernels/contact/friction_laws.py",
        "speed = wp.length(du - wp.dot(du, normal) * normal) / dt",
        "speed = wp.float64(10.0) * wp.length(du - wp.dot(du, normal) * normal) / dt",
    ),
    "caps_on_whole_faces": Mutation(
        "a node has the area of all faces around it",
        "warp_mca/physics/contact/friction_laws.py",
        "share = slave.area / np.where(triangle, 3.0, 4.0)",
        "share = slave.area",
    ),
    "slip_work_halved": Mutation(
        "half of the work of slip is counted",
        "kernels/contact/friction.py",
        "work = wp.float64(0.5) *",
        "work = wp.float64(0.25) *",
    ),
    "tangential_spring_halved": Mutation(
        "tangential springs are half as stiff as their energy takes them for",
        "kernels/contact/friction.py",
        "trial = f_start - k *",
        "trial = f_start - wp.float64(0.5) * k *",
    ),
    "belt_stands_still": Mutation(
        "slip is measured against a plane that does not move",
        "kernels/contact/contact.py",
        "du = dt * (v[i] - velocity)",
        "du = dt * v[i]",
    ),
    "belt_work_halved": Mutation(
        "half of a moving plane's work is counted",
        "kernels/contact/contact.py",
        "+ half * dt * wp.dot(before",
        "+ half * half * dt * wp.dot(before",
    ),
    "elastic_shear_soft": Mutation(
        "an elastic element's deviatoric stress is 1.99 G e in place of 2 G e",
        "kernels/elements/hex8_small.py",
        "shear = G / det",
        "shear = R(0.995) * G / det",
    ),
    "bulk_modulus_low": Mutation(
        "the bulk modulus is E / (3 (1 - nu)) in place of E / (3 (1 - 2 nu))",
        "warp_mca/scene/elastic.py",
        "return self.E / (3.0 * (1.0 - 2.0 * self.nu))",
        "return self.E / (3.0 * (1.0 - self.nu))",
    ),
    "hardening_is_tangent": Mutation(
        "the tangent modulus E_t is taken for the hardening modulus E E_t / (E - E_t)",
        "warp_mca/scene/metals.py",
        "return self.E * self.E_t / (self.E - self.E_t)",
        "return self.E_t",
    ),
    "shear_modulus_low": Mutation(
        "the shear modulus is E / (2 (1 + 2 nu)) in place of E / (2 (1 + nu))",
        "warp_mca/scene/elastic.py",
        "return self.E / (2.0 * (1.0 + self.nu))",
        "return self.E / (2.0 * (1.0 + 2.0 * self.nu))",
    ),
    "one_density": Mutation(
        "every part of a body takes the density of its first material",
        "warp_mca/physics/elements/cells.py",
        "rho[cells] = material.rho",
        "rho[cells] = body_materials(body, mesh)[0][0].rho",
    ),
    "back_stress_high": Mutation(
        "the back stress is 0.68 (1 - beta) H eps_p in place of two thirds of (1 - beta) H eps_p",
        "kernels/materials/j2.py",
        "R(2.0) * R(THIRD) * (R(1.0) - beta) * H",
        "R(0.68) * (R(1.0) - beta) * H",
    ),
    "isotropic_work_high": Mutation(
        "the plastic work of isotropic hardening is one percent too high",
        "kernels/materials/j2.py",
        "R(0.5) * beta * H * p * p",
        "R(0.505) * beta * H * p * p",
    ),
    "stress_not_turned": Mutation(
        "recorded stress is left in the element's own frame",
        "kernels/elements/readings.py",
        "Q * local * wp.transpose(Q)",
        "local",
    ),
    "return_too_short": Mutation(
        "the return to the yield surface takes twice the hardening modulus",
        "kernels/materials/j2.py",
        "(R(3.0) * G + H)",
        "(R(3.0) * G + R(2.0) * H)",
    ),
    "yield_stress_high": Mutation(
        "the yield stress is five percent too high",
        "kernels/materials/j2.py",
        "radius = sigma_y + beta",
        "radius = R(1.05) * sigma_y + beta",
    ),
    "gauss_points_moved": Mutation(
        "the Gauss points lie at 0.5 in place of 0.577",
        "kernels/elements/hexahedron.py",
        "_GAUSS = 0.5773502691896257",
        "_GAUSS = 0.5",
    ),
    "rotation_to_first_order": Mutation(
        "displacements are turned back without their own part",
        "kernels/elements/hexahedron.py",
        "add_transposed(u[a], W, X[a] + u[a])",
        "add_transposed(u[a], W, X[a])",
    ),
    "forces_not_turned_back": Mutation(
        "forces stay in the element's own frame",
        "kernels/elements/hexahedron.py",
        "f[a] = add_product(f[a], W, f[a])",
        "f[a] = add_product(f[a], W - W, f[a])",
    ),
    "rate_force_reversed": Mutation(
        "centrifugal forces of the rigid chain have the wrong sign",
        "warp_mca/rigid/plain_chain.py",
        "turning, M10 = uy * wx - ux * wy,",
        "turning, M10 = ux * wy - uy * wx,",
    ),
    "hand_off_spins_backwards": Mutation(
        "nodes take the link's angular velocity with the wrong sign at hand-off",
        "warp_mca/rigid/placement.py",
        "np.cross(self.angular_velocity, r)",
        "np.cross(r, self.angular_velocity)",
    ),
    "vibration_energy_doubled": Mutation(
        "hand-back doubles the kinetic energy that does not fit",
        "warp_mca/rigid/handback.py",
        "vibration_energy=float(0.5 * energy)",
        "vibration_energy=float(energy)",
    ),
    "far_links_weightless": Mutation(
        "inner links of the rigid chain carry half of the weight that they have with those beyond",
        "warp_mca/rigid/plain_chain.py",
        "f0 = -((b0 * k0 - a0 * s0) * gy - (-a0 * k0 - b0 * s0) * gx",
        "f0 = -(0.5 * (b0 * k0 - a0 * s0) * gy - 0.5 * (-a0 * k0 - b0 * s0) * gx",
    ),
    "pressure_varies_within_elements": Mutation(
        "each integration point adds a tenth of its own pressure to that of the element",
        "kernels/elements/hex8_small.py",
        "shear = G / det\n",
        "shear = G / det\n            trace -= R(0.15) * K / G * trace\n",
    ),
    "joint_impulse_halved": Mutation(
        "the impulse of a joint is counted by half",
        "kernels/nodes/constraint.py",
        "impulse_out[k] + m * (v - free)",
        "impulse_out[k] + wp.float64(0.5) * m * (v - free)",
    ),
    "shown_pressure_halved": Mutation(
        "the pressure in the stress that is shown is halved",
        "kernels/elements/readings.py",
        "local = cauchy(H, S, N, d, pressure)",
        "local = cauchy(H, S, N, d, R(0.5) * pressure)",
    ),
    "logarithmic_strain_doubled": Mutation(
        "logarithmic strain lacks the factor 1 / 2",
        "kernels/materials/kinematics.py",
        "mean = (e0 + e1 + e2) / R(3.0)",
        "e0, e1, e2 = R(2.0) * e0, R(2.0) * e1, R(2.0) * e2\n        mean = (e0 + e1 + e2) / R(3.0)",
    ),
    "hourglass_reversed": Mutation(
        "hourglass forces of hex8r have the wrong sign",
        "kernels/elements/patterns.py",
        "= -add_product(Q[n], W, Q[n])",
        "= add_product(Q[n], W, Q[n])",
        element="hex8r",
    ),
    "hourglass_stays_elastic": Mutation(
        "hourglass strains of hex8r do not flow where the element yields",
        "kernels/elements/hex8r.py",
        "kept = S_eq / (S_eq + R(3.0) * G * dp)",
        "kept = R(1.0)",
        element="hex8r",
    ),
    "hourglass_modulus_low": Mutation(
        "hourglass strains of hex8r along an edge take the modulus G in place of 2 G / (1 - nu)",
        "kernels/elements/hourglass.py",
        "plane = third * R(2.0) * G / (one - nu)",
        "plane = third * G",
        element="hex8r",
    ),
    "own_pressure": Mutation(
        "tetrahedra take the pressure of their own volume change in place of the nodes' means",
        "kernels/elements/tet4.py",
        "\n        strain, N, d = deviator(H)\n",
        "\n        pressure = pressure_of(law[m, 0], wp.trace(H))\n        strain, N, d = deviator(H)\n",
        element="tet4",
    ),
    "tetrahedra_twice_as_large": Mutation(
        "the volume of a tetrahedron lacks a factor 1 / 2 where its growth is found",
        "kernels/elements/tet4.py",
        "return W, H, rows, det / R(6.0)",
        "return W, H, rows, det / R(3.0)",
        element="tet4",
    ),
    "hinge_forgets_masses": Mutation(
        "two tied nodes take their plain mean motion in place of the mass-weighted one",
        "kernels/nodes/constraint.py",
        "return (m_a * a + m_b * b) / (m_a + m_b)",
        "return wp.float64(0.5) * (a + b)",
    ),
    "pin_pulls_at_the_mean": Mutation(
        "the impulse of a pin acts at the mean position of a cluster in place of the hinge",
        "kernels/nodes/couple.py",
        "where[2], where[3], lane, place[j], one.mean, J, wp.cross(P - one.mean.centre, J) + T,",
        "where[2], where[3], lane, place[j], one.mean, J, T,",
    ),
    "pin_stays_upright": Mutation(
        "the arm from the mean position of a cluster to its hinge does not turn with the body",
        "kernels/nodes/couple.py",
        "orientation_out[j, 0] = quickly_turned(orientation_out[j, 0], dt * spin_after(one.mean, a.spin, J, T))",
        "orientation_out[j, 0] = orientation_out[j, 0]",
    ),
    "beta_swapped": Mutation(
        "isotropic and kinematic hardening are swapped: 1 - beta is taken for beta",
        "warp_mca/scene/metals.py",
        "self.hardening_modulus, self.beta",
        "self.hardening_modulus, 1.0 - self.beta",
    ),
    "friction_limit_ignored": Mutation(
        "friction has no limit",
        "kernels/contact/friction.py",
        "if size > limit:",
        "if size > wp.float64(1.0e9) * limit:",
    ),
    "tangential_spring_reversed": Mutation(
        "tangential springs push the way in which they are stretched",
        "kernels/contact/friction.py",
        "trial = f_start - k *",
        "trial = f_start + k *",
    ),
    "dashpots_stiff_in_shear": Mutation(
        "dashpots of absorbing boundaries resist shear with rho c_p in place of rho c_s",
        "warp_mca/physics/absorbing/nodes.py",
        "(rho * c_p, rho * c_s)",
        "(rho * c_p, rho * c_p)",
    ),
    "slow_impulse_lost": Mutation(
        "an element with a step of its own gives its nodes the impulse of one of their steps only",
        "kernels/nodes/gather.py",
        "scale * force_at(slot, force)",
        "force_at(slot, force)",
    ),
    "gravity_reversed": Mutation(
        "gravity acts against its direction",
        "kernels/nodes/gather.py",
        "inverse * total + of(gravity",
        "inverse * total - of(gravity",
    ),
} | ELEMENT_MUTATIONS

MUTATIONS |= RIGID_MUTATIONS | ROBOT_MUTATIONS | LOAD_MUTATIONS | DAMPING_MUTATIONS | FAILURE_MUTATIONS


def notes() -> dict[str, str]:
    """A sentence for each verification case: with which deliberate errors it fails."""
    wrong = {case: "; or ".join(MUTATIONS[name].what for name in names) for case, names in CATCHES.items()}
    return {case: f"Fails, as it must, when {what}." for case, what in wrong.items()}
