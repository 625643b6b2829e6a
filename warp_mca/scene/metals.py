"""Owns the public vocabulary of metals: von Mises plasticity with the hardening and the rates of each law, checked."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene.elastic import Elastic


@dataclass(frozen=True, kw_only=True)
class J2Bilinear(Elastic):
    """Von Mises plasticity with bilinear uniaxial response.

    Attributes:
        sigma_y: initial yield stress [Pa].
        E_t: tangent modulus of the uniaxial response beyond yield [Pa], in [0, E).
        beta: share of isotropic hardening [-]: 0 kinematic, 1 isotropic.
    """

    sigma_y: float
    E_t: float
    beta: float = 0.0
    law = "warp_mca.kernels.materials.j2"

    def __post_init__(self) -> None:
        super().__post_init__()
        validate.positive("J2Bilinear", sigma_y=self.sigma_y)
        if not (validate.is_number(self.E_t) and 0.0 <= self.E_t < self.E):
            raise bad_value("J2Bilinear.E_t", self.E_t, f"the tangent modulus must lie in [0, E = {self.E:g})")
        if not (validate.is_number(self.beta) and 0.0 <= self.beta <= 1.0):
            raise bad_value("J2Bilinear.beta", self.beta, "must lie between 0 (kinematic) and 1 (isotropic)")

    @property
    def hardening_modulus(self) -> float:
        """H = E E_t / (E - E_t) [Pa], the slope of yield stress over equivalent plastic strain."""
        return self.E * self.E_t / (self.E - self.E_t)

    @property
    def parameters(self) -> tuple[float, ...]:
        """K, G, sigma_y, H [Pa] and beta [-]."""
        return *super().parameters, self.sigma_y, self.hardening_modulus, self.beta


@dataclass(frozen=True, kw_only=True)
class J2Voce(Elastic):
    """Von Mises plasticity with isotropic hardening that saturates: sigma_y + Q (1 - exp(-b p)) + H p.

    Voce, J. Inst. Metals 74 (1948) 537; p is the equivalent plastic strain [-].

    Attributes:
        sigma_y: initial yield stress [Pa].
        Q: what hardening adds in the end [Pa].
        b: how fast it does so [-]: by all but 1 / e at p = 1 / b.
        H: slope that stays [Pa].
    """

    sigma_y: float
    Q: float
    b: float
    H: float = 0.0
    law = "warp_mca.kernels.materials.voce"

    def __post_init__(self) -> None:
        super().__post_init__()
        validate.positive("J2Voce", sigma_y=self.sigma_y, b=self.b)
        _not_negative("J2Voce", Q=self.Q, H=self.H)

    @property
    def parameters(self) -> tuple[float, ...]:
        """K, G, sigma_y, Q [Pa], b [-] and H [Pa]."""
        return *super().parameters, self.sigma_y, self.Q, self.b, self.H


@dataclass(frozen=True, kw_only=True)
class J2Table(Elastic):
    """Von Mises plasticity with isotropic hardening by a table: straight lines, the last stress beyond them.

    Attributes:
        plastic_strain: true plastic strain of each point [-], from 0 on, rising.
        stress: true stress of each point [Pa], above 0, not falling.
    """

    plastic_strain: tuple[float, ...]
    stress: tuple[float, ...]
    law = "warp_mca.kernels.materials.table"

    def __post_init__(self) -> None:
        super().__post_init__()
        kind = type(self).__name__
        for name in ("plastic_strain", "stress"):
            value = getattr(self, name)
            if not (isinstance(value, tuple) and value and all(validate.is_number(entry) for entry in value)):
                raise bad_value(f"{kind}.{name}", value, "give a finite number for each point")
        p, stress = self.plastic_strain, self.stress
        if p[0] != 0.0 or not all(one < other for one, other in pairwise(p)):
            raise bad_value(f"{kind}.plastic_strain", p, "begin with 0, and let each strain be above the one before")
        if len(stress) != len(p):
            raise bad_value(f"{kind}.stress", stress, f"give as many stresses as plastic strains, {len(p)}")
        if not (stress[0] > 0.0 and all(one <= other for one, other in pairwise(stress))):
            raise bad_value(f"{kind}.stress", stress, "begin above 0, and let no stress be below the one before")

    @property
    def _table(self) -> tuple[float, ...]:
        return len(self.stress), *self.plastic_strain, *self.stress

    @property
    def parameters(self) -> tuple[float, ...]:
        """K, G, yield stress [Pa], number of points, their plastic strains [-] and stresses [Pa]."""
        return *super().parameters, self.stress[0], *self._table


@dataclass(frozen=True, kw_only=True)
class CowperSymonds(J2Table):
    """`J2Table` at rest, times 1 + (rate / D)^(1 / q) with the rate of the equivalent plastic strain.

    Cowper and Symonds, Brown University Applied Mathematics Report 28 (1957).

    Attributes:
        D: rate at which the stress is twice that at rest [1/s].
        q: exponent [-], 1 or more.
    """

    D: float
    q: float
    law = "warp_mca.kernels.materials.cowper_symonds"

    def __post_init__(self) -> None:
        super().__post_init__()
        validate.positive("CowperSymonds", D=self.D)
        if not (validate.is_number(self.q) and self.q >= 1.0):
            raise bad_value("CowperSymonds.q", self.q, "give a finite number, 1 or more")

    @property
    def parameters(self) -> tuple[float, ...]:
        """K, G, yield stress at rest [Pa], D [1/s], 1 / q [-], then the table as in `J2Table`."""
        return *super().parameters[:3], self.D, 1.0 / self.q, *self._table


@dataclass(frozen=True, kw_only=True)
class JohnsonCook(Elastic):
    """Flow stress (A + B p^n) (1 + C ln(rate / rate_0)) (1 - T*^m), T* = (T - T_room) / (T_melt - T_room).

    Johnson and Cook, Proc. 7th Int. Symp. Ballistics (1983) 541. Rates below rate_0 have no effect. The share `beta`
    of the plastic work heats the material; no heat flows.

    Attributes:
        A, B: yield stress and hardening at rate_0 and T_room [Pa].
        n, C, m: exponent of hardening, share of rates, exponent of temperature [-].
        rate_0: rate of the equivalent plastic strain at which A and B were measured [1/s].
        T_room, T_melt: temperatures [K]; at T_melt nothing is left of the stress.
        T_start: temperature at the start [K]; None is T_room. Below T_room it has no effect.
        c_p: heat capacity [J/(kg K)].
        beta: share of plastic work that becomes heat (Taylor and Quinney) [-]; 0 keeps the temperature.
    """

    A: float
    B: float
    n: float
    C: float
    m: float
    T_melt: float
    c_p: float
    T_room: float = 293.0
    T_start: float | None = None
    rate_0: float = 1.0
    beta: float = 0.9
    law = "warp_mca.kernels.materials.johnson_cook"

    def __post_init__(self) -> None:
        super().__post_init__()
        values = {name: getattr(self, name) for name in ("A", "n", "m", "rate_0", "T_room", "c_p")}
        validate.positive("JohnsonCook", **values)
        _not_negative("JohnsonCook", B=self.B, C=self.C)
        if not (validate.is_number(self.T_melt) and self.T_melt > self.T_room):
            raise bad_value("JohnsonCook.T_melt", self.T_melt, f"give a temperature above T_room = {self.T_room:g} K")
        if not (validate.is_number(self.beta) and 0.0 <= self.beta <= 1.0):
            raise bad_value("JohnsonCook.beta", self.beta, "must lie between 0 (no heat) and 1 (all work)")
        if self.T_start is not None and not (validate.is_number(self.T_start) and 0.0 <= self.T_start < self.T_melt):
            raise bad_value("JohnsonCook.T_start", self.T_start, f"give a temperature below T_melt = {self.T_melt:g} K")

    @property
    def parameters(self) -> tuple[float, ...]:
        """K, G, yield stress at the start, A, B [Pa], n, C, rate_0 [1/s], m, T* at the start, its growth [m^3/J]."""
        span = self.T_melt - self.T_room
        start = 0.0 if self.T_start is None else max(0.0, self.T_start - self.T_room) / span
        grows = self.beta / (self.rho * self.c_p * span)
        first = self.A * (1.0 - start**self.m)
        return *super().parameters, first, self.A, self.B, self.n, self.C, self.rate_0, self.m, start, grows


@dataclass(frozen=True, kw_only=True)
class Chaboche(Elastic):
    """Cyclic plasticity: two back stresses after Armstrong and Frederick, and isotropic hardening after Voce.

    Chaboche, Int. J. Plasticity 5 (1989) 247: dX = (2/3) C d eps_p - gamma X dp for each, radius
    sigma_y + Q (1 - exp(-b p)). A back stress saturates at C / gamma.

    Attributes:
        sigma_y: initial yield stress [Pa].
        C: slope at which each back stress starts [Pa]; a pair.
        gamma: how fast each saturates [-]; a pair. 0 leaves it linear, as Prager's.
        Q, b: isotropic hardening, as in `J2Voce`.
    """

    sigma_y: float
    C: tuple[float, float]
    gamma: tuple[float, float]
    Q: float = 0.0
    b: float = 0.0
    law = "warp_mca.kernels.materials.chaboche"

    def __post_init__(self) -> None:
        super().__post_init__()
        validate.positive("Chaboche", sigma_y=self.sigma_y)
        validate.entries("Chaboche", 2, _not_negative, C=self.C, gamma=self.gamma)
        _not_negative("Chaboche", Q=self.Q, b=self.b)

    @property
    def parameters(self) -> tuple[float, ...]:
        """K, G, sigma_y, Q [Pa], b [-], then C [Pa] and gamma [-] of each back stress."""
        pairs = (entry for pair in zip(self.C, self.gamma, strict=True) for entry in pair)
        return *super().parameters, self.sigma_y, self.Q, self.b, *pairs


def _not_negative(owner: str, /, **values: float) -> None:
    for name, value in values.items():
        if not (validate.is_number(value) and value >= 0.0):
            raise bad_value(f"{owner}.{name}", value, "give a finite number, 0 or more")
