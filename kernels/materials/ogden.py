"""Owns Ogden's law: sum of mu_p / alpha_p (l1^alpha_p + l2^alpha_p + l3^alpha_p - 3), of isochoric stretches l_i.

Ogden, Proc. R. Soc. A 326 (1972) 565. The name of the law ends with the number of its terms.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import THIRD, scalars
from warp_mca.kernels.materials.kinematics import eigen_function

wp.set_module_options({"enable_backward": False})


@cache
def parameters(precision: str, terms: str) -> Any:
    """The function (law, m, scale) -> mu_p [Pa] and alpha_p [-] of each term of row m of `Model.law`, in turn."""
    R = scalars(precision).real
    row = wp.types.vector(2 * int(terms), R)

    @wp.func
    def ogden_parameters(law: wp.array2d(dtype=R), m: int, scale: R):
        c = row()
        for i in range(wp.static(2 * int(terms))):
            c[i] = law[m, 3 + i]
        return c

    return ogden_parameters


@cache
def tangent_function(precision: str) -> Any:
    """The function (E_i, alpha) -> t = tanh(alpha ln l / 2) of the principal stretch l, l^2 = 1 + 2 E_i, to rounding.

    l^alpha - 1 = 2 t / (1 - t).
    """
    R = scalars(precision).real

    @wp.func
    def half_tangent(E: R, alpha: R):
        one = R(1.0)
        y = one + R(2.0) * E
        exact = y - one
        none = exact == R(0.0)
        log = wp.where(none, one, wp.log(y) / wp.where(none, one, exact)) * R(2.0) * E
        return wp.tanh(R(0.25) * alpha * log)

    return half_tangent


@cache
def mandel(precision: str, terms: str) -> Any:
    """The function (E, c) -> Mandel stress, with the principal values mu_p l_i^alpha_p less their mean."""
    t = scalars(precision)
    R, vec3, mat33, row = t.real, t.vec3, t.mat33, wp.types.vector(2 * int(terms), t.real)
    principal, tangent = eigen_function(precision), tangent_function(precision)

    @wp.func
    def ogden_stress(E: mat33, c: row):
        N, d = principal(E)
        T = vec3()
        for p in range(wp.static(int(terms))):
            for i in range(3):
                x = tangent(d[i], c[2 * p + 1])
                T[i] = T[i] + c[2 * p] * (R(2.0) * x / (R(1.0) - x))
        mean = R(THIRD) * (T[0] + T[1] + T[2])
        M = N * wp.diag(vec3(T[0] - mean, T[1] - mean, T[2] - mean)) * wp.transpose(N)
        return R(0.5) * (M + wp.transpose(M))

    return ogden_stress


@cache
def stored(precision: str, terms: str) -> Any:
    """The function (E, c) -> energy [J/m^3].

    As l1 l2 l3 = 1, the three t of `tangent_function` add up to minus their product: no digits are lost at small
    strains.
    """
    t = scalars(precision)
    R, mat33, row = t.real, t.mat33, wp.types.vector(2 * int(terms), t.real)
    principal, tangent = eigen_function(precision), tangent_function(precision)

    @wp.func
    def ogden_energy(E: mat33, c: row):
        _N, d = principal(E)
        energy = R(0.0)
        for p in range(wp.static(int(terms))):
            product, squares = R(1.0), R(0.0)
            for i in range(3):
                x = tangent(d[i], c[2 * p + 1])
                product = product * x
                squares += x * x / (R(1.0) - x)
            energy += R(2.0) * c[2 * p] / c[2 * p + 1] * (squares - product)
        return energy

    return ogden_energy
