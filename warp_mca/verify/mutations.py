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
    "reaction_halved": Mutation(
        "what touches gives back half the force that it takes",
        "kernels/contact.py",
        "total -= w[c] * spring.force[s]",
        "total -= wp.float64(0.5) * w[c] * spring.force[s]",
    ),
    "friction_limit_doubled": Mutation(
        "friction may reach 2 mu F_n",
        "kernels/contact.py",
        "normal, mu * Fn, k)",
        "normal, wp.float64(2.0) * mu * Fn, k)",
    ),
    "friction_limit_halved": Mutation(
        "friction may reach only mu F_n / 2",
        "kernels/contact.py",
        "normal, mu * Fn, k)",
        "normal, wp.float64(0.5) * mu * Fn, k)",
    ),
    "slip_work_halved": Mutation(
        "half of the work of slip is counted",
        "kernels/friction.py",
        "work = wp.float64(0.5) *",
        "work = wp.float64(0.25) *",
    ),
    "tangential_spring_halved": Mutation(
        "tangential springs are half as stiff as their energy takes them for",
        "kernels/friction.py",
        "trial = f_start - k *",
        "trial = f_start - wp.float64(0.5) * k *",
    ),
    "belt_stands_still": Mutation(
        "slip is measured against a plane that does not move",
        "kernels/contact.py",
        "du = dt * (v[i] - velocity)",
        "du = dt * v[i]",
    ),
    "belt_work_halved": Mutation(
        "half of a moving plane's work is counted",
        "kernels/contact.py",
        "+ half * dt * wp.dot(before",
        "+ half * half * dt * wp.dot(before",
    ),
    "elastic_shear_soft": Mutation(
        "an elastic element's deviatoric stress is 1.99 G e in place of 2 G e",
        "kernels/hex8.py",
        "S = R(2.0) * G * strain",
        "S = R(1.99) * G * strain",
    ),
    "bulk_modulus_low": Mutation(
        "the bulk modulus is E / (3 (1 - nu)) in place of E / (3 (1 - 2 nu))",
        "warp_mca/scene.py",
        "return self.E / (3.0 * (1.0 - 2.0 * self.nu))",
        "return self.E / (3.0 * (1.0 - self.nu))",
    ),
    "hardening_is_tangent": Mutation(
        "the tangent modulus E_t is taken for the hardening modulus E E_t / (E - E_t)",
        "warp_mca/scene.py",
        "return self.E * self.E_t / (self.E - self.E_t)",
        "return self.E_t",
    ),
    "shear_modulus_low": Mutation(
        "the shear modulus is E / (2 (1 + 2 nu)) in place of E / (2 (1 + nu))",
        "warp_mca/scene.py",
        "return self.E / (2.0 * (1.0 + self.nu))",
        "return self.E / (2.0 * (1.0 + 2.0 * self.nu))",
    ),
    "one_density": Mutation(
        "every part of a body takes the density of its first material",
        "warp_mca/model.py",
        "rho = np.array([m.rho for m in self.materials])[self.material]",
        "rho = np.array([self.materials[0].rho for m in self.materials])[self.material]",
    ),
    "back_stress_high": Mutation(
        "the back stress is 0.68 (1 - beta) H eps_p in place of two thirds of (1 - beta) H eps_p",
        "kernels/j2.py",
        "xi = S - (R(2.0) / R(3.0)) * (R(1.0) - beta) * H * eps_p",
        "xi = S - R(0.68) * (R(1.0) - beta) * H * eps_p",
    ),
    "isotropic_work_high": Mutation(
        "the plastic work of isotropic hardening is one percent too high",
        "kernels/j2.py",
        "R(0.5) * beta * H * p * p",
        "R(0.505) * beta * H * p * p",
    ),
    "stress_not_turned": Mutation(
        "recorded stress is left in the element's own frame",
        "kernels/output.py",
        "(Q * strain * wp.transpose(Q))",
        "strain",
    ),
    "return_too_short": Mutation(
        "the return to the yield surface takes twice the hardening modulus",
        "kernels/j2.py",
        "(R(3.0) * G + H)",
        "(R(3.0) * G + R(2.0) * H)",
    ),
}
