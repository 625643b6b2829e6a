"""Owns the public vocabulary of foams: crushing along a curve of stress over volume strain, checked."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene.elastic import Elastic


@dataclass(frozen=True, kw_only=True)
class CrushableFoam(Elastic):
    """Foam that crushes: principal stresses are limited by a curve over the volume strain 1 - J, Poisson's ratio is 0.

    As *MAT_CRUSHABLE_FOAM of LS-DYNA: a foam block that is compressed does not spread, so that the curve is that of
    force over area in a compression test, over shortening over height. Unloading is elastic; energy is dissipated.

    Attributes:
        E: modulus of loading and unloading [Pa], above any slope of the curve.
        crush: volume strain of each point of the curve [-], from 0 on, rising, below 1.
        stress: stress of each point [Pa], above 0, not falling; the last one holds beyond.
        tension: greatest principal stress in tension [Pa].
        nu: 0.
        least_stretch: smallest principal stretch that the stable step allows for [-], in [0.01, 1]. Beyond, the balance
            of energy tells.
    """

    E: float
    nu: float = field(init=False, default=0.0)
    crush: tuple[float, ...]
    stress: tuple[float, ...]
    tension: float
    least_stretch: float = 0.25
    law = "warp_mca.kernels.materials.crushable_foam"
    finite_only = True

    def __post_init__(self) -> None:
        super().__post_init__()
        kind = type(self).__name__
        validate.positive(kind, tension=self.tension)
        for name in ("crush", "stress"):
            value = getattr(self, name)
            if not (isinstance(value, tuple) and value and all(validate.is_number(entry) for entry in value)):
                raise bad_value(f"{kind}.{name}", value, "give a finite number for each point")
        if self.crush[0] != 0.0 or self.crush[-1] >= 1.0 or not all(a < b for a, b in pairwise(self.crush)):
            raise bad_value(f"{kind}.crush", self.crush, "begin with 0, and let each strain be above the last, below 1")
        if len(self.stress) != len(self.crush):
            raise bad_value(f"{kind}.stress", self.stress, f"give as many stresses as strains, {len(self.crush)}")
        if not (self.stress[0] > 0.0 and all(a <= b for a, b in pairwise(self.stress))):
            raise bad_value(f"{kind}.stress", self.stress, "begin above 0, and let no stress be below the last")
        points = zip(self.crush, self.stress, strict=True)
        slope = max(((t - s) / (b - a) for (a, s), (b, t) in pairwise(points)), default=0.0)
        if slope >= self.E:
            raise bad_value(f"{kind}.E", self.E, f"give more than the steepest slope of the curve, {slope:.4g} Pa")
        if not (validate.is_number(self.least_stretch) and 0.01 <= self.least_stretch <= 1.0):
            raise bad_value(f"{kind}.least_stretch", self.least_stretch, "give a stretch from 0.01 to 1")

    @property
    def bulk_modulus(self) -> float:
        """What K grows to, seen from the undeformed mesh, where a cell is crushed to `least_stretch` [Pa]."""
        return super().bulk_modulus / self.least_stretch**2

    @property
    def shear_modulus(self) -> float:
        """As `bulk_modulus`, of G [Pa]."""
        return super().shear_modulus / self.least_stretch**2

    @property
    def wave_speeds(self) -> dict[str, float]:
        """Speeds of elastic waves [m/s]: bar sqrt(E / rho), which is also the dilatational one, and shear."""
        bar = (self.E / self.rho) ** 0.5
        return {"bar": bar, "dilatational": bar, "shear": bar / 2.0**0.5}

    @property
    def yield_stress(self) -> float:
        """Stress at which it first crushes [Pa]."""
        return self.stress[0]

    @property
    def parameters(self) -> tuple[float, ...]:
        """K, G, no yield stress of von Mises, limit of tension [Pa], number of points, their strains and stresses."""
        moduli = self.E / 3.0, self.E / 2.0
        return *moduli, float("inf"), self.tension, len(self.crush), *self.crush, *self.stress
