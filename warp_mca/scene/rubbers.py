"""Owns the public vocabulary of rubbers: hyperelastic laws, for large strain only, checked."""

from __future__ import annotations

from dataclasses import dataclass, field

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene.elastic import Elastic


@dataclass(frozen=True, kw_only=True)
class Hyperelastic(Elastic):
    """What hyperelastic laws share: an energy of the isochoric stretch, and K (ln J)^2 / 2 of the volume ratio J.

    Attributes:
        nu: Poisson's ratio at small strain [-], in (-1, 0.5), from which the bulk modulus K follows. Take 0.49 to 0.499
            for rubber: waves of pressure set the stable step, which falls as sqrt(1 - 2 nu).
        E: Young's modulus at small strain [Pa], which follows from the law.
        least_stretch: smallest principal stretch that the stable step allows for [-], in [0.01, 1]: 0.7 is the width of
            a strip at twice its length, or a block at 0.7 of its height. Beyond, the balance of energy tells.
    """

    E: float = field(init=False)
    nu: float = 0.495
    least_stretch: float = 0.7
    finite_only = True
    flows = False

    def __post_init__(self) -> None:
        kind = type(self).__name__
        self._check()
        if not (validate.is_number(self.nu) and -1.0 < self.nu < 0.5):
            raise bad_value(f"{kind}.nu", self.nu, "Poisson's ratio must lie in (-1, 0.5)")
        if not (validate.is_number(self.least_stretch) and 0.01 <= self.least_stretch <= 1.0):
            raise bad_value(f"{kind}.least_stretch", self.least_stretch, "give a stretch from 0.01 to 1")
        object.__setattr__(self, "E", 2.0 * self.initial_shear_modulus * (1.0 + self.nu))
        super().__post_init__()

    def _check(self) -> None:
        """Check the fields of the law."""

    @property
    def initial_shear_modulus(self) -> float:
        """G at small strain [Pa]."""
        raise NotImplementedError

    @property
    def bulk_modulus(self) -> float:
        """What K grows to, seen from the undeformed mesh, where a cell is pressed to `least_stretch` [Pa]."""
        return super().bulk_modulus / self.least_stretch**2

    @property
    def shear_modulus(self) -> float:
        """As `bulk_modulus`, of G [Pa]."""
        return super().shear_modulus / self.least_stretch**2

    @property
    def wave_speeds(self) -> dict[str, float]:
        """Speeds of waves of small strain [m/s]: bar sqrt(E / rho), dilatational, shear."""
        found = {name: self.least_stretch * speed for name, speed in super().wave_speeds.items()}
        return {**found, "bar": found["bar"] / self.least_stretch}

    @property
    def parameters(self) -> tuple[float, ...]:
        """K and G at small strain [Pa], and no yield stress."""
        return self.bulk_modulus * self.least_stretch**2, self.initial_shear_modulus, float("inf")


@dataclass(frozen=True, kw_only=True)
class NeoHookean(Hyperelastic):
    """W = C10 (I1 - 3), with the first invariant of the isochoric stretch: rubber up to 1.5 times its length.

    Treloar, Trans. Faraday Soc. 39 (1943) 241. The shear modulus is 2 C10.

    Attributes:
        C10: modulus [Pa].
    """

    C10: float
    law = "warp_mca.kernels.materials.neo_hookean"

    def _check(self) -> None:
        validate.positive("NeoHookean", C10=self.C10)

    @property
    def initial_shear_modulus(self) -> float:
        """2 C10 [Pa]."""
        return 2.0 * self.C10


@dataclass(frozen=True, kw_only=True)
class MooneyRivlin(Hyperelastic):
    """W = C10 (I1 - 3) + C01 (I2 - 3), with the invariants of the isochoric stretch: rubber up to twice its length.

    Rivlin, Phil. Trans. R. Soc. A 241 (1948) 379. The shear modulus is 2 (C10 + C01).

    Attributes:
        C10: modulus [Pa], above 0.
        C01: modulus [Pa], 0 or more.
    """

    C10: float
    C01: float
    law = "warp_mca.kernels.materials.mooney_rivlin"

    def _check(self) -> None:
        validate.positive("MooneyRivlin", C10=self.C10)
        if not (validate.is_number(self.C01) and self.C01 >= 0.0):
            raise bad_value("MooneyRivlin.C01", self.C01, "give a finite number, 0 or more: below it is not stable")

    @property
    def initial_shear_modulus(self) -> float:
        """2 (C10 + C01) [Pa]."""
        return 2.0 * (self.C10 + self.C01)

    @property
    def parameters(self) -> tuple[float, ...]:
        """K, G, no yield stress, C10 and C01 [Pa]."""
        return *super().parameters, self.C10, self.C01


@dataclass(frozen=True, kw_only=True)
class Ogden(Hyperelastic):
    """W = sum of mu / alpha (l1^alpha + l2^alpha + l3^alpha - 3), with isochoric principal stretches l: any stretch.

    Ogden, Proc. R. Soc. A 326 (1972) 565; the shear modulus is half of the sum of mu alpha. LS-DYNA and OpenRadioss
    write it so; the mu of Abaqus is mu alpha / 2.

    Attributes:
        mu: modulus of each of one to three terms [Pa].
        alpha: exponent of each [-], with the sign of its mu.
    """

    mu: tuple[float, ...]
    alpha: tuple[float, ...]

    def _check(self) -> None:
        for name in ("mu", "alpha"):
            value = getattr(self, name)
            if isinstance(value, list):
                object.__setattr__(self, name, value := tuple(value))
            if not (isinstance(value, tuple) and 1 <= len(value) <= 3 and all(map(validate.is_number, value))):
                raise bad_value(f"Ogden.{name}", value, "give one to three finite numbers")
        if len(self.alpha) != len(self.mu):
            raise bad_value("Ogden.alpha", self.alpha, f"give as many exponents as mu has, {len(self.mu)}")
        for mu, alpha in zip(self.mu, self.alpha, strict=True):
            if not mu * alpha > 0.0:
                raise bad_value(
                    "Ogden.alpha", self.alpha, f"give each the sign of its mu, as mu alpha = {mu * alpha:g}"
                )

    @property
    def law(self) -> str:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Its module, with the number of terms."""
        return f"warp_mca.kernels.materials.ogden:{len(self.mu)}"

    @property
    def initial_shear_modulus(self) -> float:
        """Half of the sum of mu alpha [Pa]."""
        return 0.5 * sum(mu * alpha for mu, alpha in zip(self.mu, self.alpha, strict=True))

    @property
    def parameters(self) -> tuple[float, ...]:
        """K, G, no yield stress, then mu [Pa] and alpha [-] of each term."""
        pairs = (entry for pair in zip(self.mu, self.alpha, strict=True) for entry in pair)
        return *super().parameters, *pairs
