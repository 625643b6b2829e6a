"""Owns what the kernels ask of a criterion of failure: how damage grows at a material point.

The module of a criterion has the constant PARAMETERS, how many numbers `Failure.parameters` gives, and the factory
`damage`, (precision) -> function (D, point, c) -> D, which gives the damage after a step: 0 at first, the element fails
from 1 on. `point` is a `point_type`, c the parameters as a vector.
"""

from functools import cache
from importlib import import_module
from typing import Any

import warp as wp

from warp_mca.base.errors import bad_value
from warp_mca.kernels.hardware.scalars import scalars

wp.set_module_options({"enable_backward": False})


@cache
def point_type(precision: str) -> Any:
    """What criteria see of a material point."""
    t = scalars(precision)
    R, mat33 = t.real, t.mat33

    @wp.struct
    class FailingPoint:
        """A material point.

        Attributes:
            stress: Cauchy stress in any axes [Pa].
            strain: in the same axes [-].
            p: equivalent plastic strain [-].
            dp: its growth in this step [-].
            rate: of that [1/s].
            temperature: T* of laws that have one, else 0 [-].
            scale: factor on strains at failure [-].
        """

        stress: mat33
        strain: mat33
        p: R
        dp: R
        rate: R
        temperature: R
        scale: R

    return FailingPoint


@cache
def parameter_type(precision: str, count: int) -> Any:
    """The vector of so many parameters."""
    return wp.types.vector(max(1, count), scalars(precision).real)


@cache
def greatest_function(precision: str) -> Any:
    """The function that gives the greatest principal value of a symmetric tensor, by Cardano's formula."""
    t = scalars(precision)
    R, mat33 = t.real, t.mat33

    @wp.func
    def greatest_principal(T: mat33):
        mean = wp.trace(T) / R(3.0)
        S = T
        for i in range(3):
            S[i, i] = S[i, i] - mean
        J2 = R(0.5) * wp.ddot(S, S)
        r = wp.sqrt(J2 / R(3.0))
        found = mean
        if r > R(0.0):
            cosine = wp.clamp(R(0.5) * wp.determinant(S) / (r * r * r), R(-1.0), R(1.0))
            found = mean + R(2.0) * r * wp.cos(wp.acos(cosine) / R(3.0))
        return found

    return greatest_principal


@cache
def criterion(name: str, precision: str) -> tuple[Any, int]:
    """`damage` of the criterion in the module of that name, and the number of its parameters.

    Raises:
        RequestError: there is no such module, or it lacks one of these.
    """
    try:
        module = import_module(name)
        return module.damage(precision), int(module.PARAMETERS)
    except Exception as error:  # it may be of the user
        remedy = f"name a module with PARAMETERS and damage: {type(error).__name__}: {error}"
        raise bad_value("law of a criterion of failure", name, remedy) from error
