"""Owns the public vocabulary of contact laws: normal force of a penalty spring over its depth.

A law is plain, immutable data that names the module of its device functions. A new one is a dataclass made of
`ContactLaw` with a place in the table `CONTACT_LAWS`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar


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


CONTACT_LAWS: dict[str, type[ContactLaw]] = {kind.__name__: kind for kind in (Penalty,)}
