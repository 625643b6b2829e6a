"""Owns what the kernels ask of a law of plastic flow; `kernels.materials.j2` is one.

The kernels are made for one family of laws: elasticity is isotropic, flow keeps the volume, the first flow comes where
the von Mises stress passes the law's first parameter, and plastic strain and equivalent plastic strain are all the
history. Others need kernels of their own.
"""

from dataclasses import dataclass, fields
from functools import cache
from importlib import import_module
from typing import Any

from warp_mca.base.errors import bad_value

HISTORY_SIZE = 6  # xx, yy, xy, yz, xz of the plastic strain, and the equivalent plastic strain


@dataclass(frozen=True)
class Law:
    """Functions of a law in the scalars of one precision; its module makes each by a factory of that name.

    G is the shear modulus [Pa]; eps_p the plastic strain [-], symmetric and traceless; p the equivalent plastic strain
    [-], which must not shrink; c what `parameters` gives.

    Attributes:
        parameters: (law, m, scale) -> what the law wants of row m of `Model.law`, as a vector or a struct, from column
            2 on. Stresses are multiplied by `scale`, as those that `return_map` takes and gives are.
        return_map: (elastic, eps_p, p, G, c) -> (S, eps_p, p), with 2 G e of the deviatoric strain e for `elastic` and
            the deviatoric stress S [Pa]. Where nothing flows, p comes back bit for bit.
        plastic_energy: (eps_p, p, c) -> plastic work per volume [J/m^3], stored and dissipated: a function of state.
    """

    parameters: Any = None
    return_map: Any = None
    plastic_energy: Any = None


@cache
def law_functions(law_name: str, precision: str) -> Law:
    """The functions of the law in the module of that name; those of no law, "", are None.

    Raises:
        RequestError: there is no such module, or it lacks one of them.
    """
    if not law_name:
        return Law()
    try:
        module = import_module(law_name)
        factories = [getattr(module, field.name) for field in fields(Law)]
    except (ImportError, AttributeError) as error:
        remedy = f"name a module that makes {', '.join(field.name for field in fields(Law))}: {error}"
        raise bad_value("law of a material", law_name, remedy) from error
    return Law(*(factory(precision) for factory in factories))
