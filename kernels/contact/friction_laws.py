"""Owns what the kernels ask of a law of friction, which changes the limit of the tangential force.

`kernels.contact.shear_cap` is one.
"""

from functools import cache
from importlib import import_module
from typing import Any

import warp as wp

from warp_mca.base.errors import bad_value


@cache
def _own_limit(law_name: str) -> Any:
    """The device function `limit` of the law in the module of that name.

    It is (before, F_n, speed, parameters, row) -> number, all in float64: the limit of the tangential force [N] on a
    slave node. `before` is the limit without this law, mu F_n for the first of a contact [N]; F_n, above 0, the normal
    force [N]; `speed` that of the node along the master in the half step before [m/s]; parameters[row] holds what
    `FrictionLaw.parameters` gives for the node.

    Raises:
        RequestError: there is no such module, or it has no such function.
    """
    try:
        return import_module(law_name).limit
    except Exception as error:  # it may be of the user
        remedy = f"name a module that has limit: {type(error).__name__}: {error}"
        raise bad_value("law of friction", law_name, remedy) from error


@cache
def chain(law_names: tuple[str, ...]) -> Any:
    """The function that changes a limit by each law in turn; row + j are the parameters of law j."""
    first, own, last = law_names[:-1], _own_limit(law_names[-1]), len(law_names) - 1
    limit_before = chain(first) if first else None

    @wp.func
    def limit(
        before: wp.float64,
        F_n: wp.float64,
        speed: wp.float64,
        parameters: wp.array2d(dtype=wp.float64),
        row: int,
    ):
        so_far = before
        if wp.static(len(first) > 0):
            so_far = limit_before(before, F_n, speed, parameters, row)
        return own(so_far, F_n, speed, parameters, row + wp.static(last))

    return limit


@cache
def limit_function(law_names: tuple[str, ...]) -> Any:
    """The function that gives the limit of friction [N] by these laws: never negative, and 0 without a normal force."""
    by_laws, count = chain(law_names), len(law_names)

    @wp.func
    def limit(
        mu: wp.float64,
        F_n: wp.float64,
        normal: wp.vec3d,
        du: wp.vec3d,
        dt: wp.float64,
        parameters: wp.array2d(dtype=wp.float64),
        s: int,
    ):
        found = wp.float64(0.0)
        if F_n > wp.float64(0.0):
            speed = wp.length(du - wp.dot(du, normal) * normal) / dt
            found = wp.max(by_laws(mu * F_n, F_n, speed, parameters, s * wp.static(count)), wp.float64(0.0))
        return found

    return limit
