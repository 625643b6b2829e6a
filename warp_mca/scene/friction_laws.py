"""Owns the public vocabulary of laws of friction: what becomes of the limit mu F_n of the tangential force.

A law is plain, immutable data that names the module of its device function. A new one is a dataclass made of
`FrictionLaw` with a place in the table `FRICTION_LAWS`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from warp_mca.base import validate
from warp_mca.base.errors import bad_value


@dataclass(frozen=True, kw_only=True)
class FrictionLaw(ABC):
    """Base class of laws of friction.

    Attributes:
        law: module of its device function, that of `kernels.contact.friction_laws`.
    """

    law: ClassVar[str]

    @abstractmethod
    def parameters(self, area: float) -> tuple[float, ...]:
        """What its device function reads for a slave node of this area [m^2], in SI units; as many for all nodes."""

    def check(self, mu: float) -> None:  # noqa: B027, most laws go with any
        """Raise RequestError where the law does not go with the coefficient `mu` of the contact."""


@dataclass(frozen=True, kw_only=True)
class DecayingFriction(FrictionLaw):
    """A coefficient that decays from `Contact.mu` at rest with the speed v along the surface.

    mu(v) = mu_k + (mu - mu_k) exp(-d v): Oden and Martins, Comput. Methods Appl. Mech. Eng. 52 (1985) 527; in LS-DYNA
    FS = mu, FD = mu_k and DC = d.

    Attributes:
        kinetic: coefficient mu_k at high speed [-], from 0 to that at rest.
        decay: d [s/m], above 0: at the speed 3 / d all but 5 % of the fall is done.
    """

    kinetic: float
    decay: float
    law = "warp_mca.kernels.contact.decaying_friction"

    def __post_init__(self) -> None:
        validate.plain(self)
        if not (validate.is_number(self.kinetic) and self.kinetic >= 0.0):
            raise bad_value("DecayingFriction.kinetic", self.kinetic, "give a coefficient of friction, 0 or above")
        validate.positive("DecayingFriction", decay=self.decay)

    def parameters(self, area: float) -> tuple[float, ...]:
        """mu_k [-], d [s/m]."""
        return self.kinetic, self.decay

    def check(self, mu: float) -> None:
        """Raise RequestError where the coefficient would grow."""
        if self.kinetic > mu:
            remedy = f"give at most the coefficient at rest, Contact.mu = {mu:g}"
            raise bad_value("DecayingFriction.kinetic", self.kinetic, remedy)


@dataclass(frozen=True, kw_only=True)
class ShearCap(FrictionLaw):
    """A cap on the shear stress: |t| <= min(mu p, tau_max), as Abaqus' limit of shear stress and LS-DYNA's VC.

    On a node it is tau_max A with the area A of the slave's faces around it at the start of the impact: name the side
    that slides as the slave.

    Attributes:
        tau_max: greatest shear stress [Pa], above 0; often the yield stress in shear of the softer body.
    """

    tau_max: float
    law = "warp_mca.kernels.contact.shear_cap"

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.positive("ShearCap", tau_max=self.tau_max)

    def parameters(self, area: float) -> tuple[float, ...]:
        """tau_max A [N]."""
        return (self.tau_max * area,)


def friction_parameters(law: FrictionLaw, area: float) -> tuple[float, ...]:
    """What the device function of a law reads for a slave node of this area [m^2].

    Raises:
        RequestError: the law is not what `FrictionLaw` describes.
    """
    kind, name = type(law).__name__, getattr(law, "law", None)
    validate.kinds(kind, str, "name the module of its function", law=name)
    found = validate.call(f"{kind}.law", name, "parameters()", law.parameters, area)
    if not validate.is_list(found):
        raise bad_value(f"{kind}.parameters({area:g})", validate.brief(found), "give a tuple of finite numbers")
    return tuple(found)


FRICTION_LAWS: dict[str, type[FrictionLaw]] = {kind.__name__: kind for kind in (DecayingFriction, ShearCap)}
