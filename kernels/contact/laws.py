"""Owns what the kernels ask of a contact law along the normal; `kernels.contact.penalty` is one.

The kernels are made for elastic springs: the force is a function of the depth alone, and what the spring stores comes
back as it is released. A law may add a dashpot, which dissipates (`kernels.contact.dashpot`). Along the surface the
spring has the same stiffness k up to the limit of friction, mu F_n unless laws of friction change it
(`kernels.contact.friction_laws`).
"""

from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any, NamedTuple

from warp_mca.base.errors import bad_value

LINEAR = "warp_mca.kernels.contact.penalty"


class Laws(NamedTuple):
    """Modules of the laws for which a contact's kernels are made.

    Attributes:
        normal: of the force along the normal.
        friction: of the laws of friction, in the order in which they change its limit; none for Coulomb's alone.
        bond: whether some slave nodes are glued, see `kernels.contact.bond`.
        pressed: whether bodies that overlap at the start are pressed apart, see `kernels.contact.spring.shrink`.
        returns: whether springs return the energy of closing and opening, see `kernels.contact.switching`.
    """

    normal: str = LINEAR
    friction: tuple[str, ...] = ()
    bond: bool = False
    pressed: bool = False
    returns: bool = False


PLAIN = Laws()


@dataclass(frozen=True)
class LawFunctions:
    """Device functions of a law, (depth, k, parameters, s) -> number, all in float64; its module has them by this name.

    depth [m], 0 or above, says how far the spring is pressed; k is its stiffness [N/m]; parameters[s]
    holds the law's own `parameters` for spring s, shape (spring_count, parameter_count).

    Attributes:
        force: along the normal [N]; 0 at depth 0, and never negative.
        energy: that the spring stores [J], the integral of the force from 0 to the depth.
        dashpot: what a dashpot adds to the force [N], (depth, rate, k, parameters, s) -> number, with the rate of
            approach [m/s], below 0 as the bodies part; None where the module has none. With it the force may depend on
            the rate but never pulls.
    """

    force: Any
    energy: Any
    dashpot: Any = None


@cache
def law_functions(law_name: str) -> LawFunctions:
    """The functions of the law in the module of that name.

    Raises:
        RequestError: there is no such module, or it lacks one of them.
    """
    names = ("force", "energy")
    try:
        module = import_module(law_name)
        return LawFunctions(*(getattr(module, name) for name in names), getattr(module, "dashpot", None))
    except Exception as error:  # it may be of the user
        remedy = f"name a module that has {' and '.join(names)}: {type(error).__name__}: {error}"
        raise bad_value("law of a contact", law_name, remedy) from error
