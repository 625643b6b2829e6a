"""Owns what all materials have, elastic ones alone: moduli and density, checked.

A material is plain, immutable data; it raises `RequestError` with the field, the value and the remedy. One with
elasticity of its own overrides the moduli: they bound those of any state, for stable steps, penalties and hourglass
stiffness.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Real
from typing import ClassVar

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene.failure import Failure, check_failure


@dataclass(frozen=True, kw_only=True)
class Elastic:
    """Isotropic linear elasticity.

    Attributes:
        E: Young's modulus [Pa].
        nu: Poisson's ratio [-], in (-1, 0.5).
        rho: density [kg/m^3].
        failure: criterion by which elements of it fail and are removed; None: they never do.
        law: module of its law, with the functions of `kernels.materials.laws`; empty where it never flows.
        finite_only: whether it makes no sense at small strain.
        flows: whether its law, if any, has plastic strain.
    """

    E: float
    nu: float
    rho: float
    failure: Failure | None = None
    law: ClassVar[str] = ""
    finite_only: ClassVar[bool] = False
    flows: ClassVar[bool] = True

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.positive(type(self).__name__, E=self.E, rho=self.rho)
        if not (validate.is_number(self.nu) and -1.0 < self.nu < 0.5):
            raise bad_value(f"{type(self).__name__}.nu", self.nu, "Poisson's ratio must lie in (-1, 0.5)")
        check_failure(type(self).__name__, self.failure, bool(self.law) and self.flows)

    @property
    def bulk_modulus(self) -> float:
        """K = E / (3 (1 - 2 nu)) [Pa]."""
        return self.E / (3.0 * (1.0 - 2.0 * self.nu))

    @property
    def shear_modulus(self) -> float:
        """G = E / (2 (1 + nu)) [Pa]."""
        return self.E / (2.0 * (1.0 + self.nu))

    @property
    def parameters(self) -> tuple[float, ...]:
        """Its row of `Model.law`: K, G [Pa], then the initial yield stress [Pa] and what else its law reads.

        A law without yield stress gives infinity there.
        """
        return self.bulk_modulus, self.shear_modulus

    @property
    def yield_stress(self) -> float:
        """Von Mises stress at which it first flows [Pa], infinite where it never does."""
        return self.parameters[2] if self.law else math.inf

    @property
    def wave_speeds(self) -> dict[str, float]:
        """Speeds of elastic waves [m/s]: bar sqrt(E / rho), dilatational c_d, shear c_s."""
        K, G = self.bulk_modulus, self.shear_modulus
        moduli = {"bar": self.E, "dilatational": K + 4.0 * G / 3.0, "shear": G}
        return {name: math.sqrt(modulus / self.rho) for name, modulus in moduli.items()}


def check_law(material: Elastic) -> None:
    """Check the law and the parameters of a material, which may be of a class from outside the package.

    Raises:
        RequestError: the law is no text, or the parameters are not the numbers that `Elastic.parameters` describes.
    """
    kind = type(material).__name__
    validate.kinds(kind, str, "name the module of its functions, or leave it out", law=material.law)
    row = validate.call(f"{kind}.law", material.law, "parameters", lambda: material.parameters)
    least = 3 if material.law else 2
    sound = isinstance(row, tuple | list) and len(row) >= least
    if not (sound and all(isinstance(entry, Real) and not math.isnan(entry) for entry in row)):
        remedy = f"give {least} numbers or more: K, G [Pa] and, with a law, the yield stress and what else it reads"
        raise bad_value(f"{kind}.parameters", row, remedy)
