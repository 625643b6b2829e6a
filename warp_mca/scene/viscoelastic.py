"""Owns the public vocabulary of viscoelasticity: a Prony series on an elastic or hyperelastic material, checked."""

from __future__ import annotations

from dataclasses import dataclass, field

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene.elastic import Elastic
from warp_mca.scene.rubbers import Hyperelastic

TERMS = 6  # at most
COLUMN = 9  # of the series in the row of the law, see `kernels.materials.prony`


@dataclass(frozen=True, kw_only=True)
class Prony(Elastic):
    """Linear viscoelasticity: moduli G (1 - sum g (1 - exp(-t / tau))), and K alike with k.

    Simo and Hughes, Computational Inelasticity (1998), section 10.3. At finite strain what relaxes is the stress
    conjugate to logarithmic strain. The ledger counts what is lost as dissipated with plastic work.

    Attributes:
        elastic: an `Elastic`, `NeoHookean`, `MooneyRivlin` or `Ogden`, whose moduli are those of an instant; divide
            long-term ones by 1 - sum g.
        g: share of the shear modulus that each of one to six terms relaxes [-], above 0, below 1 together.
        tau: time of each term [s].
        k: share of the bulk modulus that each term relaxes [-], 0 or more, below 1 together; empty: it does not relax.
        E, nu, rho: those of `elastic`.
    """

    E: float = field(init=False)
    nu: float = field(init=False)
    rho: float = field(init=False)
    elastic: Elastic
    g: tuple[float, ...]
    tau: tuple[float, ...]
    k: tuple[float, ...] = ()
    flows = False

    def __post_init__(self) -> None:
        if type(self.elastic) is not Elastic and not isinstance(self.elastic, Hyperelastic):
            remedy = "give an Elastic, NeoHookean, MooneyRivlin or Ogden, whose stress the series relaxes"
            raise bad_value("Prony.elastic", self.elastic, remedy)
        if self.elastic.failure is not None:
            raise bad_value("Prony.elastic", self.elastic, "give its failure to the Prony series in place of this")
        for name in ("E", "nu", "rho"):
            object.__setattr__(self, name, getattr(self.elastic, name))
        for name in ("g", "tau", "k"):
            value = getattr(self, name)
            if not (validate.is_list(value) and all(validate.is_number(entry) for entry in value)):
                raise bad_value(f"Prony.{name}", value, "give a finite number for each term")
        super().__post_init__()
        if not 1 <= len(self.g) <= TERMS:
            raise bad_value("Prony.g", self.g, f"give one to {TERMS} terms")
        if not (min(self.g) > 0.0 and sum(self.g) < 1.0):
            raise bad_value("Prony.g", self.g, "give shares above 0, below 1 together; leave out terms of 0")
        if len(self.tau) != len(self.g) or not min(self.tau) > 0.0:
            raise bad_value("Prony.tau", self.tau, f"give as many times above 0 s as g has terms, {len(self.g)}")
        if self.k and (len(self.k) != len(self.g) or min(self.k) < 0.0 or sum(self.k) >= 1.0):
            remedy = f"give a share of 0 or more for each of the {len(self.g)} terms, below 1 together"
            raise bad_value("Prony.k", self.k, remedy)

    @property
    def law(self) -> str:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Its module, with the number of terms and the law that relaxes."""
        module = "prony_bulk" if any(self.k) else "prony"
        return f"warp_mca.kernels.materials.{module}:{len(self.g)}:{self.elastic.law}"

    @property
    def finite_only(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        """As that of `elastic`."""
        return self.elastic.finite_only

    @property
    def bulk_modulus(self) -> float:
        """Of an instant [Pa], as that of `elastic`."""
        return self.elastic.bulk_modulus

    @property
    def shear_modulus(self) -> float:
        """Of an instant [Pa], as that of `elastic`."""
        return self.elastic.shear_modulus

    @property
    def wave_speeds(self) -> dict[str, float]:
        """Of waves that are too fast to relax [m/s]."""
        return self.elastic.wave_speeds

    @property
    def parameters(self) -> tuple[float, ...]:
        """The row of `elastic`, filled up; g [-], tau [s] and k [-] of each term."""
        row = self.elastic.parameters
        row = row if len(row) > 2 else (*row, float("inf"))
        k = self.k or (0.0,) * len(self.g)
        return *row, *[0.0] * (COLUMN - len(row)), *self.g, *self.tau, *k
