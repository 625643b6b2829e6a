"""Owns the public vocabulary of failure: criteria by which the elements of a material fail and are removed.

A criterion is plain, immutable data that names the module of its device functions. A new one is a dataclass made of
`Failure` with a place in the table `FAILURES`.
"""

from __future__ import annotations

from abc import ABC
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from warp_mca.base import validate
from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value

if TYPE_CHECKING:
    from warp_mca.scene.contacts import Contact, ContactAll


@dataclass(frozen=True, kw_only=True)
class Failure(ABC):
    """Base class of criteria, as `Elastic.failure` takes them: an element fails where damage reaches 1 at one point.

    Attributes:
        law: module of its device functions, those of `kernels.failure.criteria`.
        plastic: whether it needs plastic strain, so that elastic materials are refused.
    """

    law: ClassVar[str]
    plastic: ClassVar[bool] = True

    @property
    def parameters(self) -> tuple[float, ...]:
        """What its device functions read, in SI units."""
        return ()

    def scale(self, length: Array) -> Array:
        """Factors on its strain at failure in cells of these lengths [m], shape (cell_count,), float64."""
        return np.ones_like(length)


@dataclass(frozen=True, kw_only=True)
class StrainFailure(Failure):
    """What criteria of strains share: their strain at failure may hold for one length of cells.

    Attributes:
        reference_length: of cells, for which the strain at failure is given [m]. In cells of length h, the cube root
            of their volume, it is (reference_length / h)^length_exponent times as much. None: the same in all cells.
        length_exponent: 1 keeps the energy per area of a crack where all strain gathers in one row of cells (Bazant and
            Oh, Materiaux et Constructions 16 (1983) 155). Ahead of cracks and notches in metals that yield around them
            it spreads, and 0.5 does: plates changed by 0.1 to 8 % from h to h / 2, by 25 to 44 % with 1 or without.
    """

    reference_length: float | None = None
    length_exponent: float = 0.5

    def __post_init__(self) -> None:
        validate.plain(self)
        if self.reference_length is not None:
            validate.positive(type(self).__name__, reference_length=self.reference_length)
        if not (validate.is_number(self.length_exponent) and 0.0 <= self.length_exponent <= 1.0):
            field = f"{type(self).__name__}.length_exponent"
            raise bad_value(field, self.length_exponent, "give 0, for no effect of the length, to 1")

    def scale(self, length: Array) -> Array:
        """(reference_length / h)^length_exponent."""
        if self.reference_length is None:
            return np.ones_like(length)
        return (self.reference_length / length) ** self.length_exponent


@dataclass(frozen=True, kw_only=True)
class PlasticStrainFailure(StrainFailure):
    """Fails where the equivalent plastic strain reaches a limit.

    Attributes:
        strain: equivalent plastic strain at failure [-].
    """

    strain: float
    law = "warp_mca.kernels.failure.plastic_strain"

    def __post_init__(self) -> None:
        super().__post_init__()
        validate.positive("PlasticStrainFailure", strain=self.strain)

    @property
    def parameters(self) -> tuple[float, ...]:
        """The strain [-]."""
        return (self.strain,)


@dataclass(frozen=True, kw_only=True)
class JohnsonCookFailure(StrainFailure):
    """Damage D = sum of dp / eps_f, eps_f = (D1 + D2 exp(D3 eta)) (1 + D4 ln(rate / rate_0)) (1 + D5 T*).

    Johnson and Cook, Eng. Fract. Mech. 21 (1985) 31. eta is the mean stress over the von Mises stress, 1.5 at most;
    rates below rate_0 have no effect; T* is that of `JohnsonCook`, 0 with other materials. Fails where D reaches 1.

    Attributes:
        D1, D2, D3, D4, D5: of the strain at failure [-]; D3 is negative where tension is worse than compression.
        rate_0: rate of the equivalent plastic strain at which they were measured [1/s].
        least_strain: strain at failure where the expression gives less, or less than 0 [-]: EFMIN of
            *MAT_JOHNSON_COOK. By default such points fail at their first flow.
    """

    D1: float
    D2: float
    D3: float
    D4: float = 0.0
    D5: float = 0.0
    rate_0: float = 1.0
    least_strain: float = 1e-6
    law = "warp_mca.kernels.failure.johnson_cook"

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("D1", "D2", "D3", "D4", "D5"):
            if not validate.is_number(getattr(self, name)):
                raise bad_value(f"JohnsonCookFailure.{name}", getattr(self, name), "give a finite number")
        validate.positive("JohnsonCookFailure", rate_0=self.rate_0, least_strain=self.least_strain)
        if not self.D1 + self.D2 > 0.0:
            raise bad_value("JohnsonCookFailure.D1", self.D1, "D1 + D2, the strain at failure in shear, is above 0")

    @property
    def parameters(self) -> tuple[float, ...]:
        """D1 to D5 [-], rate_0 [1/s] and the least strain at failure [-]."""
        return self.D1, self.D2, self.D3, self.D4, self.D5, self.rate_0, self.least_strain


@dataclass(frozen=True, kw_only=True)
class PrincipalStressFailure(Failure):
    """Fails where the greatest principal stress reaches a limit.

    Attributes:
        stress: greatest principal Cauchy stress at failure [Pa].
    """

    stress: float
    law = "warp_mca.kernels.failure.principal_stress"
    plastic = False

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.positive("PrincipalStressFailure", stress=self.stress)

    @property
    def parameters(self) -> tuple[float, ...]:
        """The stress [Pa]."""
        return (self.stress,)


@dataclass(frozen=True, kw_only=True)
class PrincipalStrainFailure(StrainFailure):
    """Fails where the greatest principal strain reaches a limit; logarithmic where `Body.kinematics` is finite.

    Attributes:
        strain: greatest principal strain at failure [-].
    """

    strain: float
    law = "warp_mca.kernels.failure.principal_strain"
    plastic = False

    def __post_init__(self) -> None:
        super().__post_init__()
        validate.positive("PrincipalStrainFailure", strain=self.strain)

    @property
    def parameters(self) -> tuple[float, ...]:
        """The strain [-]."""
        return (self.strain,)


FAILURES: dict[str, type[Failure]] = {
    kind.__name__: kind
    for kind in (PlasticStrainFailure, JohnsonCookFailure, PrincipalStressFailure, PrincipalStrainFailure)
}


def check_failure(owner: str, failure: object, flows: bool) -> None:
    """Check the criterion of a material of the class `owner`, which has plastic strain if it `flows`.

    Raises:
        RequestError: it is no criterion, or cannot be met.
    """
    if failure is None:
        return
    if not isinstance(failure, Failure) or type(failure) not in FAILURES.values():
        remedy = f"give {' or '.join(FAILURES)}; register other classes by warp_mca.register"
        raise bad_value(f"{owner}.failure", validate.brief(failure), remedy)
    if failure.plastic and not flows:
        remedy = "it needs plastic strain, and this material never flows; give a law that does, or another criterion"
        raise bad_value(f"{owner}.failure", type(failure).__name__, remedy)


def check_contacts(failing: Sequence[str], contacts: Sequence[Contact | ContactAll]) -> None:
    """Refuse contacts that do not follow the surface of bodies whose elements may fail.

    Raises:
        RequestError: there is such a contact.
    """
    for item in contacts if failing else ():
        sides = getattr(item, "sides", failing)
        for body in (name for name in failing if name in sides):
            what = f"Body {body}: failure"
            if not hasattr(item, "sides"):
                raise bad_value(what, "ContactAll", "it does not follow bodies that fail; list their pairs as Contacts")
            if getattr(item, "bond", None):
                raise bad_value(what, "Bond", "bonds do not go with elements that may fail; leave out one of them")
            if item.initial_overlap == "press":
                raise bad_value(what, "press", "bodies that fail are not pressed apart; choose another initial_overlap")
