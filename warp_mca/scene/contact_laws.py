"""Owns the public vocabulary of contact laws: normal force of a penalty spring over its depth.

A law is plain, immutable data that names the module of its device functions. A new one is a dataclass made of
`ContactLaw` with a place in the table `CONTACT_LAWS`.
"""

from __future__ import annotations

import math
import sys
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

from warp_mca.base import validate
from warp_mca.base.errors import bad_value


@dataclass(frozen=True, kw_only=True)
class ContactLaw(ABC):
    """Base class of contact laws.

    Attributes:
        law: module of its device functions, those of `kernels.contact.laws`.
    """

    law: ClassVar[str]

    @property
    def parameters(self) -> tuple[float, ...]:
        """What its device functions read, in SI units."""
        return ()

    @abstractmethod
    def stiffening(self, depth: float) -> float:
        """Greatest slope dF/dg up to a depth [m], as a multiple of the stiffness k [-]: it bounds the time step."""

    def damping(self, depth: float) -> float:
        """Greatest slope of the dashpot's force over the rate of approach up to a depth [m], over k [s]: it bounds the
        time step; 0 for a law without `dashpot`."""
        return 0.0


@dataclass(frozen=True, kw_only=True)
class Penalty(ContactLaw):
    """The linear spring, F_n = k g."""

    law = "warp_mca.kernels.contact.penalty"

    def stiffening(self, depth: float) -> float:
        """1 at any depth."""
        return 1.0


@dataclass(frozen=True, kw_only=True)
class DampedPenalty(ContactLaw):
    """The linear spring and a dashpot beside it, F_n = k (g + time r), which never pull.

    Attributes:
        time: of the dashpot [s]. A share z of the critical damping of a node of mass m takes 2 z sqrt(m / k).
        speed: bound of the rate of approach r, to either side [m/s]; inf for none.
    """

    time: float
    speed: float = math.inf
    law = "warp_mca.kernels.contact.damped_penalty"

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.positive("DampedPenalty", time=self.time)
        if self.speed != math.inf:
            validate.positive("DampedPenalty", speed=self.speed)

    @property
    def parameters(self) -> tuple[float, ...]:
        """The time [s] and the speed [m/s]."""
        return self.time, min(self.speed, sys.float_info.max)

    def stiffening(self, depth: float) -> float:
        """As of the linear spring."""
        return 1.0

    def damping(self, depth: float) -> float:
        """The time [s]."""
        return self.time


def law_values(law: ContactLaw | None, depth: float) -> dict[str, Any]:
    """Law (None: `Penalty`), parameters, stiffening and damping that a contact pass has, for depths up to `depth` [m].

    Raises:
        RequestError: one of them is not what `ContactLaw` describes.
    """
    law = law or Penalty()
    kind, name = type(law).__name__, getattr(law, "law", None)
    validate.kinds(kind, str, "name the module of its functions", law=name)
    parameters = validate.call(f"{kind}.law", name, "parameters", lambda: law.parameters)
    if not validate.is_list(parameters):
        raise bad_value(f"{kind}.parameters", validate.brief(parameters), "give a tuple of finite numbers")
    found = {"law": name, "parameters": tuple(parameters)}
    for key in ("stiffening", "damping"):
        found[key] = value = validate.call(f"{kind}.law", name, f"{key}()", getattr(law, key), depth)
        if not (validate.is_number(value) and value >= 0.0):
            raise bad_value(f"{kind}.{key}({depth:g})", validate.brief(value), "give a finite number, 0 or above")
    return found


CONTACT_LAWS: dict[str, type[ContactLaw]] = {kind.__name__: kind for kind in (Penalty, DampedPenalty)}
